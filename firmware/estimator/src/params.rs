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
        let mut params = Self::from_checked(calibration, health_of(calibration)?);
        params.reduced.tabulate(&calibration.oil);
        Ok(params)
    }

    /// Checks a calibration and puts its parameters into `place`: without a copy of them on the stack, of which a controller
    /// has little.
    ///
    /// # Errors
    /// As [`new`](Self::new); then nothing is there.
    pub fn replace(place: &mut Option<Self>, calibration: &Calibration) -> Result<(), CalibrationError> {
        *place = None;
        put(place, calibration, health_of(calibration)?);
        if let Some(params) = place {
            params.reduced.tabulate(&calibration.oil);
        }
        Ok(())
    }

    /// Checks a calibration as [`new`](Self::new) does, and prepares nothing.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn check(calibration: &Calibration) -> Result<(), CalibrationError> {
        health_of(calibration).map(|_| ())
    }

    /// All but the table of compression.
    fn from_checked(calibration: &Calibration, health: HealthParams) -> Self {
        Self {
            health,
            reduced: ReducedModel::from_checked(calibration.reduced, Compression::empty(&calibration.oil)),
            law: Law::from_checked(calibration.law),
            region: calibration.region,
            errors: calibration.sensor_errors,
            ranges: calibration.sensor_ranges,
            limits: calibration.limits,
            output: calibration.machine.output,
            low_pressure: calibration.machine.low_pressure,
        }
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

// Not inlined: while the calibration is checked, nothing of this is needed on the stack.
#[inline(never)]
fn put(place: &mut Option<Params>, calibration: &Calibration, health: HealthParams) {
    *place = Some(Params::from_checked(calibration, health));
}

/// Everything that is checked; health comes last, since it follows from the other parts.
// Not inlined: its copies of other parts would lie on the stack beside the parameters that are being made.
#[inline(never)]
fn health_of(calibration: &Calibration) -> Result<HealthParams, CalibrationError> {
    check::all(calibration)?;
    let mut reduced = ReducedModel::from_checked(calibration.reduced, Compression::empty(&calibration.oil));
    reduced.tabulate(&calibration.oil);
    let law = Law::from_checked(calibration.law);
    let machine = MachineParts {
        reduced: &reduced,
        law: &law,
        errors: &calibration.sensor_errors,
        limits: &calibration.limits,
        low_pressure: calibration.machine.low_pressure,
    };
    HealthParams::new(&calibration.health, &machine)
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
