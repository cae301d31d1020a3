//! Checked parameters: a calibration that has passed every check, prepared for evaluation.

use crate::calibration::validate;
use crate::calibration::{Calibration, CalibrationError, Limits, Output, SensorErrors, SensorRanges};
use crate::health::{HealthContext, HealthParams, MachineParts};
use crate::model::calibrated_model::CalibratedModel;
use crate::model::calibrated_region::RegionConfig;
use crate::model::flow_balance::ReducedModel;
use crate::model::leakage_law::Law;
use crate::model::oil_compression::Compression;
use crate::units::Megapascal;

/// Everything a step needs to know. Immutable; may be swapped for another between two steps.
#[derive(Debug, Clone, PartialEq)]
pub struct Params {
    pub(crate) model: CalibratedModel,
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
        params.model.reduced.tabulate(&calibration.oil);
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
            params.model.reduced.tabulate(&calibration.oil);
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
            model: untabulated(calibration),
            region: calibration.region,
            errors: calibration.sensor_errors,
            ranges: calibration.sensor_ranges,
            limits: calibration.limits,
            output: calibration.machine.output,
            low_pressure: calibration.machine.low_pressure,
        }
    }

    /// What health monitoring borrows.
    #[inline(always)]
    pub(crate) fn health_context(&self) -> HealthContext<'_> {
        HealthContext { params: &self.health, model: &self.model }
    }

    /// The reduced model.
    #[must_use]
    pub fn reduced(&self) -> &ReducedModel {
        &self.model.reduced
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
        &self.model.law
    }
}

/// Flow balance and law, the table of compression still empty.
#[inline(always)]
fn untabulated(calibration: &Calibration) -> CalibratedModel {
    CalibratedModel {
        reduced: ReducedModel::from_checked(calibration.reduced, Compression::empty(&calibration.oil)),
        law: Law::from_checked(calibration.law),
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
    validate::all(calibration)?;
    let mut model = untabulated(calibration);
    model.reduced.tabulate(&calibration.oil);
    let machine = MachineParts {
        model: &model,
        errors: &calibration.sensor_errors,
        limits: &calibration.limits,
        low_pressure: calibration.machine.low_pressure,
    };
    HealthParams::new(&calibration.health, &machine)
}
