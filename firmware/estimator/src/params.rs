//! Checked parameters: a calibration that has passed every check, prepared for evaluation.

use crate::calibration::check::{self, CalibrationError};
use crate::calibration::{Calibration, Limits, Output, SensorErrors, SensorRanges};
use crate::health::{HealthParams, MachineParts};
use crate::law::Law;
use crate::oil::{Compression, OilConfig};
use crate::reduced::{ReducedConfig, ReducedModel};
use crate::region::RegionConfig;
use crate::units::Megapascal;

/// Everything a step needs to know. Immutable; may be swapped for another between two steps.
#[derive(Debug, Clone, PartialEq)]
pub struct Params {
    pub(crate) reduced: ReducedModel,
    pub(crate) law: Law,
    pub(crate) region: RegionConfig,
    pub(crate) errors: SensorErrors,
    pub(crate) ranges: SensorRanges,
    pub(crate) limits: Limits,
    pub(crate) output: Output,
    pub(crate) low_pressure: Megapascal,
    pub(crate) health: HealthParams,
}

impl Params {
    /// Checks a calibration and prepares it.
    ///
    /// # Errors
    /// The first field that is not finite, out of range or inconsistent with another.
    pub fn new(calibration: &Calibration) -> Result<Self, CalibrationError> {
        check::all(calibration)?;
        let reduced =
            ReducedModel::from_checked(calibration.reduced, Compression::from_checked(&calibration.oil));
        let law = Law::from_checked(calibration.law);
        let low_pressure = calibration.machine.low_pressure;
        let (errors, limits) = (calibration.sensor_errors, calibration.limits);
        let machine =
            MachineParts { reduced: &reduced, law: &law, errors: &errors, limits: &limits, low_pressure };
        let health = HealthParams::new(&calibration.health, &machine)?;
        Ok(Self {
            reduced,
            law,
            region: calibration.region,
            errors,
            ranges: calibration.sensor_ranges,
            limits,
            output: calibration.machine.output,
            low_pressure,
            health,
        })
    }

    /// The reduced model.
    #[must_use]
    pub fn reduced(&self) -> &ReducedModel {
        &self.reduced
    }

    /// Declared spans of the sensors.
    #[must_use]
    pub fn sensor_ranges(&self) -> &SensorRanges {
        &self.ranges
    }

    /// Where the drive counts as working.
    #[must_use]
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// Pressure of the low line where it is not measured.
    #[must_use]
    pub fn low_pressure(&self) -> Megapascal {
        self.low_pressure
    }

    /// How health is learned and judged.
    #[must_use]
    pub fn health(&self) -> &HealthParams {
        &self.health
    }

    /// The leakage law.
    #[must_use]
    pub fn law(&self) -> &Law {
        &self.law
    }
}

impl ReducedModel {
    /// Checks the constants of a reduced model and prepares it, without a law: identification needs it before one exists.
    ///
    /// # Errors
    /// The first field that is not finite or out of range.
    pub fn new(reduced: &ReducedConfig, oil: &OilConfig) -> Result<Self, CalibrationError> {
        check::oil(oil)?;
        check::reduced(reduced)?;
        Ok(Self::from_checked(*reduced, Compression::from_checked(oil)))
    }
}
