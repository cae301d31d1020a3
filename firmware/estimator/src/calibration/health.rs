//! Configuration of health monitoring.

use serde::{Deserialize, Serialize};

use super::error::{CalibrationError, consistent, in_range};
use crate::model::leakage_law::LawConfig;
use crate::units::{Celsius, Megapascal, Ratio, RevPerMin};

/// Configuration of health monitoring, unchecked. `docs/health/theory.md` derives the effect of each number.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HealthConfig {
    /// Length of a block, in microseconds.
    pub block_us: u32,
    /// Standard deviation of the law's misfit over operating points, relative to Kou.
    pub law_misfit: f32,
    /// Number of successive blocks that share one misfit, since they share one operating point.
    pub misfit_blocks: f32,
    /// Standard deviation of the random error of a single sample's ratio, relative.
    pub ratio_noise: f32,
    /// Standard deviation of the level's change by wear alone in an hour of driving with the gate open; grows with the
    /// root of time (random walk).
    pub level_drift_per_h: f32,
    /// Smallest change of the level worth a report.
    pub report_change: f32,
    /// Mean time of driving with the gate open between two false reports of a step, in hours (average run length to a
    /// false alarm, ARL0).
    #[serde(rename = "run_length_h")]
    pub false_alarm_interval_h: f32,
    /// Level (leakage over the law's) at which the machine is due for overhaul.
    pub limit_level: Ratio,
    /// Pump speed of the rated point, for severity.
    #[serde(rename = "rated_n_p_rpm")]
    pub rated_speed: RevPerMin,
    /// Pressure of the rated point.
    #[serde(rename = "rated_p_h_mpa")]
    pub rated_pressure: Megapascal,
    /// Oil temperature of the rated point.
    #[serde(rename = "rated_t_b_c")]
    pub rated_temperature: Celsius,
}

impl HealthConfig {
    /// Defaults for sensors of common accuracy classes and a drive like the reference machine.
    pub const DEFAULT: Self = Self {
        block_us: 500_000,
        law_misfit: 0.02,
        misfit_blocks: 15.0,
        // Two speeds of 0.05 % each: a toothed wheel over 10 ms.
        ratio_noise: 7e-4,
        level_drift_per_h: 0.01,
        report_change: 0.05,
        false_alarm_interval_h: 1e5,
        limit_level: Ratio(2.0),
        rated_speed: RevPerMin(2000.0),
        rated_pressure: Megapascal(35.0),
        rated_temperature: Celsius(60.0),
    };

    /// The defaults, with a rated point at 0.7 of the law's normalisers.
    #[must_use]
    pub const fn for_law(law: &LawConfig) -> Self {
        Self {
            rated_speed: RevPerMin(0.7 * law.n_max.get()),
            rated_pressure: Megapascal(0.7 * law.p_max.get()),
            rated_temperature: Celsius(0.67 * law.t_max.get()),
            ..Self::DEFAULT
        }
    }

    /// Checks the range of each field.
    pub(crate) fn check(&self) -> Result<(), CalibrationError> {
        // 10 ms is the fastest estimate period, 10 s is slower than any manoeuvre.
        let block = (10_000..=10_000_000).contains(&self.block_us);
        consistent("health.block_us", block, "allowed: 10000 to 10000000 microseconds")?;
        in_range("health.law_misfit", self.law_misfit, 1e-3, 0.5)?;
        in_range("health.misfit_blocks", self.misfit_blocks, 1.0, 1000.0)?;
        in_range("health.ratio_noise", self.ratio_noise, 0.0, 0.1)?;
        in_range("health.level_drift_per_h", self.level_drift_per_h, 1e-4, 2.0)?;
        in_range("health.report_change", self.report_change, 0.02, 1.0)?;
        in_range("health.run_length_h", self.false_alarm_interval_h, 1.0, 1e9)?;
        in_range("health.limit_level", self.limit_level.get(), 1.05, 20.0)?;
        in_range("health.rated_n_p_rpm", self.rated_speed.get(), 50.0, 20_000.0)?;
        in_range("health.rated_p_h_mpa", self.rated_pressure.get(), 1.0, 100.0)?;
        in_range("health.rated_t_b_c", self.rated_temperature.get(), -40.0, 150.0)
    }
}
