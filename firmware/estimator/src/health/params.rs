//! Checked parameters of health monitoring, and derived quantities of the machine.

use serde::{Deserialize, Serialize};

use super::averaging::RegressionSample;
use super::cusum::CusumThresholds;
use super::fault_isolation::other_signatures;
use super::tuning::{DIAGNOSIS_DECISIONS, MISFIT_SHARE, OFFSET_VARIANCE_MIN, START_HOLDOFF_DECISIONS};
use crate::calibration::error::{CalibrationError, consistent};
use crate::calibration::{HealthConfig, Limits, SensorErrors};
use crate::model::flow_balance::{OperatingPoint, ReducedModel};
use crate::model::leakage_law::Law;
use crate::units::{LeakageCoefficient, LitrePerMin, Megapascal, Ratio};

/// Parts of a calibration from which the parameters of health monitoring follow.
pub(crate) struct HealthInputs<'a> {
    /// Flow balance.
    pub reduced: &'a ReducedModel,
    /// Leakage law.
    pub law: &'a Law,
    /// Standard errors of the sensors.
    pub errors: &'a SensorErrors,
    /// Operating limits of the estimator.
    pub limits: &'a Limits,
    /// Pressure of the low line where it is not measured.
    pub low_pressure: Megapascal,
}

/// Checked configuration of health monitoring, with thresholds and variances derived from it.
#[derive(Debug, Clone, PartialEq)]
pub struct HealthParams {
    pub(super) config: HealthConfig,
    pub(super) cusum: CusumThresholds,
    /// Systematic variance of the level, as a quadratic in the level, lowest power first.
    systematic2: [f32; 3],
    /// Variance of the ratio offset before anything was learned.
    pub(super) offset_variance: f32,
    /// Hold-off after the start, in blocks; prolonged until the level is learned.
    pub(super) start_holdoff_blocks: u16,
    /// Hold-off after a change, and number of blocks from which its causes are isolated.
    pub(super) diagnosis_blocks: u16,
    /// Leakage coefficient by the law at the rated point, (L/min)/MPa.
    rated_kou: f32,
    rated_leakage_l_min_per_kou: f32,
    rated_ratio_per_kou: f32,
}

impl HealthParams {
    /// Checks the configuration against the machine and derives the parameters.
    ///
    /// # Errors
    /// The first field that is inconsistent with the machine; ranges have been checked before.
    pub(crate) fn new(config: &HealthConfig, inputs: &HealthInputs<'_>) -> Result<Self, CalibrationError> {
        let above = config.rated_pressure.get() - inputs.low_pressure.get();
        let loaded = above >= inputs.limits.min_pressure_difference.get();
        consistent("health.rated_p_h_mpa", loaded, "is not above the low pressure by what counts as loaded")?;
        let at = OperatingPoint {
            pump_speed: config.rated_speed,
            high_pressure: config.rated_pressure,
            low_pressure: inputs.low_pressure,
            oil_temperature: config.rated_temperature,
            displacement: Ratio(1.0),
        };
        let law = inputs.law;
        let kou = law.evaluate(law.normalised(at.pump_speed, at.high_pressure, at.oil_temperature));
        let balance = inputs.reduced.balance(&at);
        let mean = RegressionSample {
            ratio_residual: 0.0,
            ratio_per_kou: 1.0 / balance.kou_per_ratio(),
            kou_law: kou.get(),
            ratio: balance.ratio(kou).get(),
            n_p_rpm: at.pump_speed.get(),
            p_h_mpa: at.high_pressure.get(),
            t_b_c: at.oil_temperature.get(),
            alpha: 1.0,
            chi: balance.compression_loss().get(),
        };
        let per_level = mean.ratio_per_kou * mean.kou_law;
        // An error of pressure or temperature acts through compression, independent of leakage, and through the
        // leakage, in proportion to the level: with zero sensitivity to leakage only compression remains.
        let without = RegressionSample { ratio_per_kou: 0.0, ..mean };
        let [pressure_0, temperature_0, ..] = other_signatures(inputs.reduced, law, &without);
        let [pressure_1, temperature_1, ..] = other_signatures(inputs.reduced, law, &mean);
        let by_pressure = inputs.errors.high_pressure_relative * config.rated_pressure.get() / per_level;
        let by_temperature = inputs.errors.oil_temperature.get() / per_level;
        let mut systematic2 = [0.0, 0.0, MISFIT_SHARE * config.law_misfit * MISFIT_SHARE * config.law_misfit];
        for (constant, with_level) in [
            (by_pressure * pressure_0, by_pressure * (pressure_1 - pressure_0)),
            (by_temperature * temperature_0, by_temperature * (temperature_1 - temperature_0)),
        ] {
            let [s0, s1, s2] = &mut systematic2;
            *s0 += constant * constant;
            *s1 += 2.0 * constant * with_level;
            *s2 += with_level * with_level;
        }
        let sound = systematic2.iter().all(|s| s.is_finite()) && kou.get() > 0.0 && mean.ratio > 0.0;
        consistent("health.rated_n_p_rpm", sound, "the law is not positive at the rated point")?;
        let offset = inputs.errors.ratio_relative;
        Ok(Self {
            config: *config,
            cusum: CusumThresholds::new(config),
            systematic2,
            offset_variance: (offset * offset).max(OFFSET_VARIANCE_MIN),
            start_holdoff_blocks: (START_HOLDOFF_DECISIONS * config.misfit_blocks) as u16,
            diagnosis_blocks: (DIAGNOSIS_DECISIONS * config.misfit_blocks) as u16,
            rated_kou: kou.get(),
            rated_leakage_l_min_per_kou: balance.leakage(LeakageCoefficient(1.0)).get(),
            rated_ratio_per_kou: mean.ratio_per_kou,
        })
    }

    /// Systematic variance of the level, which no driving averages out: errors of pressure and temperature, misfit of
    /// the law.
    #[inline(always)]
    pub(super) fn systematic_variance(&self, level: f32) -> f32 {
        let [s0, s1, s2] = self.systematic2;
        s0 + level * (s1 + level * s2)
    }

    /// Severity of a level at the rated point.
    #[must_use]
    pub fn severity(&self, level: Ratio) -> Severity {
        let kou = level.get() * self.rated_kou;
        Severity {
            leakage: LitrePerMin(kou * self.rated_leakage_l_min_per_kou),
            ratio_loss: Ratio(kou * self.rated_ratio_per_kou),
            of_new: level,
            kou: LeakageCoefficient(kou),
        }
    }

    /// The configuration.
    #[must_use]
    pub const fn config(&self) -> &HealthConfig {
        &self.config
    }
}

/// Severity of a level of leakage in terms of the drive.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Severity {
    /// Leakage flow of all chambers at the rated point.
    pub leakage: LitrePerMin,
    /// Loss of speed ratio by leakage at the rated point.
    pub ratio_loss: Ratio,
    /// Leakage over that of the calibrated new state.
    pub of_new: Ratio,
    /// Leakage coefficient of one chamber at the rated point.
    pub kou: LeakageCoefficient,
}
