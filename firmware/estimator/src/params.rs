//! Checked parameters: a calibration that has passed every check, prepared for evaluation.

use crate::calibration::validate;
use crate::calibration::{Calibration, CalibrationError, Limits, OutputSensor, SensorErrors, SensorRanges};
use crate::health::{HealthContext, HealthInputs, HealthParams};
use crate::model::calibrated_region::RegionConfig;
use crate::model::flow_balance::ReducedModel;
use crate::model::leakage_law::Law;
use crate::model::oil_compression::Compression;
use crate::units::Megapascal;

/// Checked parameters of one machine. Immutable; may be exchanged between two steps.
#[derive(Debug, Clone, PartialEq)]
pub struct Params {
    /// Equations of the machine and parameters of health monitoring.
    pub(crate) context: HealthContext,
    pub(crate) region: RegionConfig,
    pub(crate) errors: SensorErrors,
    pub(crate) ranges: SensorRanges,
    pub(crate) limits: Limits,
    pub(crate) output: OutputSensor,
    pub(crate) low_pressure: Megapascal,
}

impl Params {
    /// Checks a calibration and prepares it.
    ///
    /// # Errors
    /// The first field that is not finite, out of range or inconsistent with another.
    pub fn new(calibration: &Calibration) -> Result<Self, CalibrationError> {
        let mut params = Self::from_checked(calibration, checked_health(calibration)?);
        params.context.reduced.tabulate(&calibration.oil);
        Ok(params)
    }

    /// Checks a calibration and writes its parameters to `place` directly, to spare the stack of a controller a copy.
    ///
    /// # Errors
    /// As [`new`](Self::new); `place` is then empty.
    pub fn replace(place: &mut Option<Self>, calibration: &Calibration) -> Result<(), CalibrationError> {
        *place = None;
        write_params(place, calibration, checked_health(calibration)?);
        if let Some(params) = place {
            params.context.reduced.tabulate(&calibration.oil);
        }
        Ok(())
    }

    /// Checks a calibration as [`new`](Self::new) does, without preparing parameters.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn check(calibration: &Calibration) -> Result<(), CalibrationError> {
        checked_health(calibration).map(|_| ())
    }

    /// Parameters with an empty compression table.
    fn from_checked(calibration: &Calibration, health: HealthParams) -> Self {
        Self {
            context: HealthContext {
                params: health,
                reduced: ReducedModel::from_checked(
                    calibration.reduced,
                    Compression::empty(&calibration.oil),
                ),
                law: Law::from_checked(calibration.law),
            },
            region: calibration.region,
            errors: calibration.sensor_errors,
            ranges: calibration.sensor_ranges,
            limits: calibration.limits,
            output: calibration.machine.output,
            low_pressure: calibration.machine.low_pressure,
        }
    }

    /// The flow balance (reduced model).
    #[must_use]
    pub fn reduced(&self) -> &ReducedModel {
        &self.context.reduced
    }

    /// Declared ranges of the sensors.
    #[must_use]
    pub fn sensor_ranges(&self) -> &SensorRanges {
        &self.ranges
    }

    /// Operating limits of the estimator.
    #[must_use]
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// Pressure of the low line where it is not measured.
    #[must_use]
    pub fn low_pressure(&self) -> Megapascal {
        self.low_pressure
    }

    /// Parameters of health monitoring.
    #[must_use]
    pub fn health(&self) -> &HealthParams {
        &self.context.params
    }

    /// The leakage law.
    #[must_use]
    pub fn law(&self) -> &Law {
        &self.context.law
    }
}

// Not inlined: while the calibration is checked, none of this is needed on the stack.
#[inline(never)]
fn write_params(place: &mut Option<Params>, calibration: &Calibration, health: HealthParams) {
    *place = Some(Params::from_checked(calibration, health));
}

/// Checks everything; health last, since it follows from the other parts.
// Not inlined: its temporary model would occupy the stack together with the parameters under construction.
#[inline(never)]
fn checked_health(calibration: &Calibration) -> Result<HealthParams, CalibrationError> {
    validate::all(calibration)?;
    let mut reduced = ReducedModel::from_checked(calibration.reduced, Compression::empty(&calibration.oil));
    reduced.tabulate(&calibration.oil);
    let law = Law::from_checked(calibration.law);
    let inputs = HealthInputs {
        reduced: &reduced,
        law: &law,
        errors: &calibration.sensor_errors,
        limits: &calibration.limits,
        low_pressure: calibration.machine.low_pressure,
    };
    HealthParams::new(&calibration.health, &inputs)
}
