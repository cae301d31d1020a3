//! Settings of health: as written, as checked, and what follows from them for one machine.

use serde::{Deserialize, Serialize};

use super::block::Terms;
use super::signature::signatures_of_others;
use super::step_watch::StepThresholds;
use crate::calibration::check::{CalibrationError, consistent, in_range};
use crate::calibration::{Limits, SensorErrors};
use crate::law::{Law, LawConfig};
use crate::reduced::{OperatingPoint, ReducedModel};
use crate::units::{Celsius, LeakageCoefficient, LitrePerMin, Megapascal, Ratio, RevPerMin};

/// How health is learned and judged, unchecked. `docs/health.md` derives what each number does.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HealthConfig {
    /// Length of a block, in microseconds.
    pub block_us: u32,
    /// Standard deviation of the law's misfit over operating points, relative to Kou.
    pub law_misfit: f32,
    /// Number of successive blocks over which the misfit stays the same, since the operating point does.
    pub misfit_blocks: f32,
    /// Standard deviation of the random error of a single sample's ratio, relative.
    pub ratio_noise: f32,
    /// Standard deviation of what wear alone may do to the level in an hour of judged driving; over other times it grows
    /// with their root.
    pub level_drift_per_h: f32,
    /// Smallest change of the level that is worth a report.
    pub report_change: f32,
    /// Mean time of judged driving between two false reports of a step, in hours.
    pub run_length_h: f32,
    /// Level, leakage over the law's, at which the machine is to be overhauled.
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
    /// Settings that suit sensors of the usual classes and a drive like the reference machine.
    pub const USUAL: Self = Self {
        block_us: 500_000,
        law_misfit: 0.02,
        misfit_blocks: 15.0,
        // Two speeds of 0.05 % each: a toothed wheel over 10 ms.
        ratio_noise: 7e-4,
        level_drift_per_h: 0.01,
        report_change: 0.05,
        run_length_h: 1e5,
        limit_level: Ratio(2.0),
        rated_speed: RevPerMin(2000.0),
        rated_pressure: Megapascal(35.0),
        rated_temperature: Celsius(60.0),
    };

    /// The usual settings, with a rated point at 0.7 of what this law was normalised with.
    #[must_use]
    pub const fn for_law(law: &LawConfig) -> Self {
        Self {
            rated_speed: RevPerMin(0.7 * law.n_max.get()),
            rated_pressure: Megapascal(0.7 * law.p_max.get()),
            rated_temperature: Celsius(0.67 * law.t_max.get()),
            ..Self::USUAL
        }
    }

    /// Ranges of the fields by themselves.
    pub(crate) fn check(&self) -> Result<(), CalibrationError> {
        // 10 ms is the fastest estimate period, 10 s is slower than any manoeuvre.
        let block = (10_000..=10_000_000).contains(&self.block_us);
        consistent("health.block_us", block, "allowed: 10000 to 10000000 microseconds")?;
        in_range("health.law_misfit", self.law_misfit, 1e-3, 0.5)?;
        in_range("health.misfit_blocks", self.misfit_blocks, 1.0, 1000.0)?;
        in_range("health.ratio_noise", self.ratio_noise, 0.0, 0.1)?;
        in_range("health.level_drift_per_h", self.level_drift_per_h, 1e-4, 2.0)?;
        in_range("health.report_change", self.report_change, 0.02, 1.0)?;
        in_range("health.run_length_h", self.run_length_h, 1.0, 1e9)?;
        in_range("health.limit_level", self.limit_level.get(), 1.05, 20.0)?;
        in_range("health.rated_n_p_rpm", self.rated_speed.get(), 50.0, 20_000.0)?;
        in_range("health.rated_p_h_mpa", self.rated_pressure.get(), 1.0, 100.0)?;
        in_range("health.rated_t_b_c", self.rated_temperature.get(), -40.0, 150.0)
    }
}

/// What of a machine health depends on.
pub(crate) struct MachineParts<'a> {
    pub reduced: &'a ReducedModel,
    pub law: &'a Law,
    pub errors: &'a SensorErrors,
    pub limits: &'a Limits,
    pub low_pressure: Megapascal,
}

/// Checked settings of one machine, with what follows from them.
#[derive(Debug, Clone, PartialEq)]
pub struct HealthParams {
    pub(super) config: HealthConfig,
    pub(super) step: StepThresholds,
    /// Variance of the level by what no driving averages out, as a quadratic in the level, lowest power first.
    systematic2: [f32; 3],
    /// Blocks after the start before changes are judged, if the level is learned by then.
    pub(super) settle_blocks: u16,
    /// Blocks after a change from which its causes are judged; until then no other is.
    pub(super) judge_blocks: u16,
    /// Law at the rated point.
    rated_kou: f32,
    rated_leakage_l_min_per_kou: f32,
    rated_ratio_per_kou: f32,
}

/// Share of the law's misfit that stays in the mean over an hour of driving: a smooth misfit has some three independent
/// values over the envelope.
const MISFIT_SHARE: f32 = 0.58;

/// Decisions, that is plateaus, after the start before changes are judged.
const SETTLE_DECISIONS: f32 = 7.0;
/// Decisions after a change from which its causes are judged: some five minutes of driving. Fewer operating points do not
/// tell a slope from a misfit.
const JUDGE_DECISIONS: f32 = 16.0;

impl HealthParams {
    /// Checks the settings against the machine.
    ///
    /// # Errors
    /// The first field that is inconsistent with the machine; ranges have been checked before.
    pub(crate) fn new(config: &HealthConfig, machine: &MachineParts<'_>) -> Result<Self, CalibrationError> {
        let above = config.rated_pressure.get() - machine.low_pressure.get();
        let loaded = above >= machine.limits.min_pressure_difference.get();
        consistent("health.rated_p_h_mpa", loaded, "is not above the low pressure by what counts as loaded")?;
        let at = OperatingPoint {
            pump_speed: config.rated_speed,
            high_pressure: config.rated_pressure,
            low_pressure: machine.low_pressure,
            oil_temperature: config.rated_temperature,
            displacement: Ratio(1.0),
        };
        let law = machine.law;
        let kou = law.evaluate(law.normalised(at.pump_speed, at.high_pressure, at.oil_temperature));
        let balance = machine.reduced.balance(&at);
        let mean = Terms {
            deficit: 0.0,
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
        // An error of pressure or temperature acts through compression, whatever leaks, and through the leakage, in
        // proportion to the level: where leakage cannot be seen in the ratio, only compression remains.
        let without = Terms { ratio_per_kou: 0.0, ..mean };
        let [pressure_0, temperature_0, ..] = signatures_of_others(machine.reduced, law, &without);
        let [pressure_1, temperature_1, ..] = signatures_of_others(machine.reduced, law, &mean);
        let by_pressure = machine.errors.high_pressure_relative * config.rated_pressure.get() / per_level;
        let by_temperature = machine.errors.oil_temperature.get() / per_level;
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
        Ok(Self {
            config: *config,
            step: StepThresholds::new(config),
            systematic2,
            settle_blocks: (SETTLE_DECISIONS * config.misfit_blocks) as u16,
            judge_blocks: (JUDGE_DECISIONS * config.misfit_blocks) as u16,
            rated_kou: kou.get(),
            rated_leakage_l_min_per_kou: balance.leakage(LeakageCoefficient(1.0)).get(),
            rated_ratio_per_kou: mean.ratio_per_kou,
        })
    }

    /// Variance of a level by what no driving averages out: errors of pressure and temperature, misfit of the law.
    #[inline(always)]
    pub(super) fn systematic_variance(&self, level: f32) -> f32 {
        let [s0, s1, s2] = self.systematic2;
        s0 + level * (s1 + level * s2)
    }

    /// What a level of leakage, over the law's, means at the rated point.
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

    /// The settings.
    #[must_use]
    pub const fn config(&self) -> &HealthConfig {
        &self.config
    }
}

/// What a level of leakage means, in terms of the drive.
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
