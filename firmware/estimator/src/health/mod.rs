//! Health: what the leakage has become, slowly learned while driving, and whether it has changed.
//!
//! Every valid sample goes into a block (`block`); a block passes the gate when speed, pressure, displacement and ratio
//! are steady (`steady`). The deficit of ratio of a block is explained by four parameters, learned recursively
//! (`ud`):
//!
//! * the level: leakage over the law's, less 1. It may change, so it is forgotten slowly;
//! * a factor on the ratio: displacement or speed scale, constant. It would otherwise look like a leak that depends on
//!   pressure: 1 % of ratio is 65 % of Kou at 10 MPa and 14 % at 45;
//! * slopes of the level with pressure and with temperature, constant: what the law misses of the machine.
//!
//! The level is watched in two ways: a two-sided cumulative sum of the deficit's innovations finds steps, the distance of
//! the learned level from the reference finds drifts. A change found is reported, never silently followed; then the causes
//! are told apart by their signatures (`signature`), and only where nothing but leakage remains is wear confirmed.
//!
//! All of it is fixed in size, bounded in value, and the state can be saved and restored without changing a bit of what
//! follows. [`observe`] takes a sample beside [`crate::step()`]; calibration record, link and firmware do not carry it
//! yet. `docs/health.md` states gate, recursion and thresholds, and what `host-sim evaluate` measured.

mod block;
mod signature;
mod steady;
mod trend;
mod trouble;
mod ud;

use serde::{Deserialize, Serialize};

use crate::calibration::check::{CalibrationError, consistent, in_range};
use crate::estimate::{Expected, Reason};
use crate::law::LawConfig;
use crate::params::Params;
use crate::reading::Sample;
use crate::reduced::OperatingPoint;
use crate::root::square_root;
use crate::step::{expect, measured_ratio, operating_point};
use crate::units::{Celsius, LeakageCoefficient, LitrePerMin, Megapascal, Micros, Ratio, RevPerMin};
pub use block::Terms;
use block::{Accumulator, Block};
pub use signature::{CAUSES, Cause, Causes};
use signature::{Diagnosis, signatures};
use steady::SteadyFilter;
pub use trend::{Remaining, Slope, Trend};
pub use trouble::{Stage, Trouble};
use ud::{PARAMETERS, UdFilter};

/// How health is learned and judged, unchecked.
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
    /// Largest change of the level that one hour of judged driving may bring by wear alone.
    pub level_drift_per_h: f32,
    /// Smallest change of the level that is worth a report.
    pub report_change: f32,
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
    /// Settings that suit a machine with this law and sensors of the usual classes.
    #[must_use]
    pub fn for_law(law: &LawConfig) -> Self {
        Self {
            block_us: 500_000,
            law_misfit: 0.02,
            misfit_blocks: 15.0,
            // Two speeds of 0.05 % each: a toothed wheel over 10 ms.
            ratio_noise: 7e-4,
            level_drift_per_h: 0.1,
            report_change: 0.05,
            limit_level: Ratio(2.0),
            rated_speed: RevPerMin(0.7 * law.n_max.get()),
            rated_pressure: Megapascal(0.7 * law.p_max.get()),
            rated_temperature: Celsius(0.67 * law.t_max.get()),
        }
    }

    fn check(&self) -> Result<(), CalibrationError> {
        // 10 ms is the fastest estimate period, 10 s is slower than any manoeuvre.
        let block = (10_000..=10_000_000).contains(&self.block_us);
        consistent("health.block_us", block, "allowed: 10000 to 10000000 microseconds")?;
        in_range("health.law_misfit", self.law_misfit, 1e-3, 0.5)?;
        in_range("health.misfit_blocks", self.misfit_blocks, 1.0, 1000.0)?;
        in_range("health.ratio_noise", self.ratio_noise, 0.0, 0.1)?;
        in_range("health.level_drift_per_h", self.level_drift_per_h, 1e-4, 2.0)?;
        in_range("health.report_change", self.report_change, 0.02, 1.0)?;
        in_range("health.limit_level", self.limit_level.get(), 1.05, 20.0)?;
        in_range("health.rated_n_p_rpm", self.rated_speed.get(), 50.0, 20_000.0)?;
        in_range("health.rated_p_h_mpa", self.rated_pressure.get(), 1.0, 100.0)?;
        in_range("health.rated_t_b_c", self.rated_temperature.get(), -40.0, 150.0)
    }
}

/// Checked settings of one machine, with what follows from them and its parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct HealthParams {
    config: HealthConfig,
    /// Variance of the level by what no driving averages out.
    systematic2: f32,
}

impl HealthParams {
    /// Checks the settings against the machine's parameters.
    ///
    /// # Errors
    /// The first field that is not finite, out of range or inconsistent with the machine.
    pub fn new(config: &HealthConfig, params: &Params) -> Result<Self, CalibrationError> {
        config.check()?;
        let above = config.rated_pressure.get() - params.low_pressure.get();
        let loaded = above >= params.limits.min_pressure_difference.get();
        consistent("health.rated_p_h_mpa", loaded, "is not above the low pressure by what counts as loaded")?;
        let unchecked = Self { config: *config, systematic2: 0.0 };
        let systematic2 = unchecked.systematic_variance(params);
        let sound = systematic2.is_finite() && unchecked.severity(params, 1.0).kou.get() > 0.0;
        consistent("health.rated_n_p_rpm", sound, "the law is not positive at the rated point")?;
        Ok(Self { config: *config, systematic2 })
    }

    fn rated_point(&self, params: &Params) -> OperatingPoint {
        OperatingPoint {
            pump_speed: self.config.rated_speed,
            high_pressure: self.config.rated_pressure,
            low_pressure: params.low_pressure,
            oil_temperature: self.config.rated_temperature,
            displacement: Ratio(1.0),
        }
    }

    /// What a level of leakage, over the law's, means at the rated point.
    #[must_use]
    pub fn severity(&self, params: &Params, level: f32) -> Severity {
        let at = self.rated_point(params);
        let law =
            params.law.evaluate(params.law.normalised(at.pump_speed, at.high_pressure, at.oil_temperature));
        let kou = LeakageCoefficient(level * law.get());
        let balance = params.reduced.balance(&at);
        Severity {
            leakage: balance.leakage(kou),
            ratio_loss: Ratio(kou.get() / balance.kou_per_ratio()),
            of_new: Ratio(level),
            kou,
        }
    }

    /// Variance of the level at the rated point by systematic errors of pressure and temperature.
    fn systematic_variance(&self, params: &Params) -> f32 {
        let at = self.rated_point(params);
        let kou =
            params.law.evaluate(params.law.normalised(at.pump_speed, at.high_pressure, at.oil_temperature));
        let balance = params.reduced.balance(&at);
        let mean = Terms {
            deficit: 0.0,
            ratio_per_kou: 1.0 / balance.kou_per_ratio(),
            kou_law: kou.get(),
            ratio: balance.ratio(kou).get(),
            n_p_rpm: at.pump_speed.get(),
            p_h_mpa: at.high_pressure.get(),
            t_b_c: at.oil_temperature.get(),
            alpha: 1.0,
            chi: balance.lost_fraction().get(),
        };
        let per_level = mean.ratio_per_kou * mean.kou_law;
        let [.., pressure, temperature, _, _] = signatures(params, &mean);
        let by_pressure = pressure / per_level * params.errors.high_pressure.get();
        let by_temperature = temperature / per_level * params.errors.oil_temperature.get();
        by_pressure * by_pressure + by_temperature * by_temperature
    }
}

/// Takes a sample into the learned state. To be called with every sample that [`crate::step()`] takes.
#[must_use]
pub fn observe(params: &Params, health: &HealthParams, state: &mut HealthState, sample: &Sample) -> Health {
    match terms(params, sample) {
        Ok(_) if sample.time < state.accumulator.last() => {
            state.skip(health, sample.time, Reason::TimeReversed)
        }
        Ok(terms) => state.takes(params, health, sample.time, terms),
        Err(reason) => state.skip(health, sample.time, reason),
    }
}

/// What a sample contributes, or why nothing.
fn terms(params: &Params, sample: &Sample) -> Result<Terms, Reason> {
    let at = operating_point(params, sample)?;
    let balance = params.reduced.balance(&at);
    let Expected { kou, ratio: by_law, .. } = expect(params, &at, &balance)?;
    // Also above the leak-free ratio: to leave such samples out would bias the mean.
    let ratio = measured_ratio(params, &at, sample)?;
    Ok(Terms {
        deficit: by_law.get().abs() - ratio.get().abs(),
        ratio_per_kou: 1.0 / balance.kou_per_ratio(),
        kou_law: kou.get(),
        ratio: ratio.get().abs(),
        n_p_rpm: at.pump_speed.get(),
        p_h_mpa: at.high_pressure.get(),
        t_b_c: at.oil_temperature.get(),
        alpha: at.displacement.get().abs(),
        chi: balance.lost_fraction().get(),
    })
}

/// Why the gate is closed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Closed {
    /// The sample has no valid measured ratio, or lies where the law does not hold.
    Sample(Reason),
    /// A block is being filled.
    Filling,
    /// The block before was too long ago to say whether this one is steady.
    AfterGap,
    /// Pump speed is not steady.
    SpeedUnsteady,
    /// Pressure is not steady.
    PressureUnsteady,
    /// Displacement is not steady.
    DisplacementUnsteady,
    /// The deficit of ratio is not steady.
    RatioUnsteady,
}

/// A change that was found.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Change {
    /// When it was found.
    pub time: Micros,
    /// Level before, leakage over the law's.
    pub from: Ratio,
    /// Level found.
    pub to: Ratio,
    /// Whether it came as a step, found by the cumulative sum, or as a drift.
    pub step: bool,
}

/// What the learned state says after a sample.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Health {
    /// Whether this sample completed a block that was used, or why not.
    pub gate: Result<(), Closed>,
    /// Level: leakage over the law's.
    pub level: Ratio,
    /// Standard error of the level, with what the time since the last used block may have changed and what no driving
    /// averages out: systematic errors of pressure and temperature, misfit of the law.
    pub level_se: Ratio,
    /// Factor on the ratio that is not leakage, less 1.
    pub ratio_offset: Ratio,
    /// Number of changes reported since the state was reset.
    pub changes: u16,
    /// Causes that remain for the last change; empty when there was none or nothing is known yet.
    pub causes: Causes,
    /// Trouble: the machine leaks more than it did, and nothing but leakage explains it.
    pub wear: Stage,
    /// Trouble: a sensor, the displacement or the oil explains a change, and leakage does not.
    pub sensor: Stage,
}

/// What changes. At most 1 KiB; `Clone` and serialisation keep every bit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct HealthState {
    accumulator: Accumulator,
    speed: SteadyFilter,
    pressure: SteadyFilter,
    displacement: SteadyFilter,
    deficit: SteadyFilter,
    filter: UdFilter,
    /// What is watched as it was after the start or after the last change, and slowly averaged now.
    reference: f32,
    reference_blocks: u16,
    slow: f32,
    /// Cumulative sums upwards and downwards, in units of level.
    sum_up: f32,
    sum_down: f32,
    /// Blocks for which the reference still follows what is learned: after the start and after a change.
    settling: u16,
    /// Mean over used blocks of what a unit of ratio offset amounts to, in units of level.
    lever: f32,
    /// Blocks, while a sensor is suspected, in which the deficit was as before the change.
    as_before: u16,
    suspect: bool,
    /// Time of the last block that was used.
    used: Option<Micros>,
    changes: u16,
    last_change: Option<Change>,
    /// Parameters before the last change, against which its causes are told apart.
    before: [f32; PARAMETERS],
    diagnosis: Diagnosis,
    causes: Causes,
    wear: Trouble,
    sensor: Trouble,
    trend: Trend,
    trend_blocks: u16,
}

/// Largest variance of the level: what is known right after a step, that is a standard deviation of 0.3.
const LEVEL_VARIANCE_MAX: f32 = 0.09;
/// Standard deviation of the level of a machine as it was calibrated.
const LEVEL_SD_START: f32 = 0.05;
/// Smallest variance of the factor on the ratio: sensors that are declared to be perfect are good to 0.01 %.
const OFFSET_VARIANCE_MIN: f32 = 1e-8;
/// Standard deviation of the slopes of the level with normalised pressure and temperature.
const SLOPE_SD: f32 = 0.15;
/// Bounds of level less 1, ratio offset and slopes.
const BOUNDS: [(f32, f32); PARAMETERS] = [(-0.95, 20.0), (-0.05, 0.05), (-0.6, 0.6), (-0.6, 0.6)];
/// Normalised pressure and temperature about which the slopes turn: the middle of where machines work.
const SLOPE_PIVOTS: [f32; 2] = [0.55, 0.7];
/// Blocks in which the reference follows the level after the start.
const SETTLE_START: u16 = 400;
/// Blocks in which it does so after a suspicion has ended.
const SETTLE_CHANGE: u16 = 40;
/// Blocks over which the reference is averaged: some two hours of driving.
const REFERENCE_BLOCKS: u16 = 4000;
/// Weight of a block in the slow mean of what is watched.
const SLOW_WEIGHT: f32 = 1.0 / 200.0;
/// Standard error of the slow mean over that of what is watched.
const SLOW_SHARE: f32 = 0.5;
/// Weight of a block in the mean lever.
const LEVER_WEIGHT: f32 = 1.0 / 512.0;
/// Blocks as before the change that end the suspicion of a sensor: some minutes.
const RECOVERY_BLOCKS: u16 = 300;
/// Cumulative sum at which a step is reported, in units of level times blocks.
const SUM_LIMIT: f32 = 1.2;
/// Largest contribution of one block to the cumulative sum: one wild block reports nothing.
const SUM_STEP_MAX: f32 = 0.4;
/// Standard errors by which it must have left the reference, beside the change that is worth a report.
const DRIFT_SIGMAS: f32 = 2.0;
/// Blocks between two points of the trend: about five minutes.
const TREND_BLOCKS: u16 = 600;
/// Blocks from which the causes of a change are judged: a dozen plateaus, some five minutes of driving.
const JUDGE_BLOCKS: u32 = 240;
const JUDGE_BLOCKS_U16: u16 = JUDGE_BLOCKS as u16;

impl Default for HealthState {
    fn default() -> Self {
        Self::new()
    }
}

impl HealthState {
    /// State of a machine as it was calibrated.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            accumulator: Accumulator::new(),
            speed: SteadyFilter::new(0.0),
            pressure: SteadyFilter::new(0.0),
            displacement: SteadyFilter::new(0.0),
            deficit: SteadyFilter::new(0.0),
            filter: UdFilter::new([0.0; PARAMETERS], [LEVEL_SD_START * LEVEL_SD_START; PARAMETERS]),
            reference: 0.0,
            reference_blocks: 0,
            slow: 0.0,
            sum_up: 0.0,
            sum_down: 0.0,
            settling: SETTLE_START,
            lever: 0.0,
            as_before: 0,
            suspect: false,
            used: None,
            changes: 0,
            last_change: None,
            before: [0.0; PARAMETERS],
            diagnosis: Diagnosis::new(),
            causes: Causes::none(),
            wear: Trouble::new(),
            sensor: Trouble::new(),
            trend: Trend::new(),
            trend_blocks: 0,
        }
    }

    /// The last change that was reported.
    #[must_use]
    pub fn last_change(&self) -> Option<Change> {
        self.last_change
    }

    /// The trouble "leaks more than it did", with its history.
    #[must_use]
    pub fn wear(&self) -> &Trouble {
        &self.wear
    }

    /// The trouble "a sensor or the oil explains a change", with its history.
    #[must_use]
    pub fn sensor(&self) -> &Trouble {
        &self.sensor
    }

    /// Time until the limit of the calibration, once a trend is known.
    #[must_use]
    pub fn remaining(&self, health: &HealthParams) -> Option<Remaining> {
        let [level, ..] = self.filter.theta();
        self.trend.remaining(Ratio(1.0 + level), health.config.limit_level)
    }

    /// Slope of the level over hours of judged driving, once a trend is known.
    #[must_use]
    pub fn slope(&self) -> Option<Slope> {
        self.trend.slope()
    }

    /// What the level means at the rated point of the calibration.
    #[must_use]
    pub fn severity(&self, params: &Params, health: &HealthParams) -> Severity {
        let [level, ..] = self.filter.theta();
        health.severity(params, 1.0 + level)
    }

    /// Takes a sample that has no valid terms.
    fn skip(&mut self, health: &HealthParams, time: Micros, reason: Reason) -> Health {
        self.accumulator.clear();
        self.report(health, time, Err(Closed::Sample(reason)))
    }

    /// Takes the terms of a valid sample.
    fn takes(&mut self, params: &Params, health: &HealthParams, time: Micros, terms: Terms) -> Health {
        let gate = match self.accumulator.takes(time, terms, health.config.block_us) {
            None => Err(Closed::Filling),
            Some(block) => self.gate(&block).map(|()| self.use_block(params, &health.config, &block)),
        };
        self.report(health, time, gate)
    }

    /// Whether a block is steady. Every filter takes every block, so that it knows the present when the gate opens.
    fn gate(&mut self, block: &Block) -> Result<(), Closed> {
        let mean = &block.mean;
        if block.after_gap {
            self.speed = SteadyFilter::new(mean.n_p_rpm);
            self.pressure = SteadyFilter::new(mean.p_h_mpa);
            self.displacement = SteadyFilter::new(mean.alpha);
            self.deficit = SteadyFilter::new(mean.deficit);
            return Err(Closed::AfterGap);
        }
        // Deviations that change the balance by less than a per cent of Kou, see docs/health.md.
        let speed = self.speed.takes(mean.n_p_rpm, 0.005 * mean.n_p_rpm);
        let pressure = self.pressure.takes(mean.p_h_mpa, 0.4);
        let displacement = self.displacement.takes(mean.alpha, 0.003);
        let deficit = self.deficit.takes(mean.deficit, 0.004);
        if !speed {
            Err(Closed::SpeedUnsteady)
        } else if !pressure {
            Err(Closed::PressureUnsteady)
        } else if !displacement {
            Err(Closed::DisplacementUnsteady)
        } else if !deficit {
            Err(Closed::RatioUnsteady)
        } else {
            Ok(())
        }
    }

    fn use_block(&mut self, params: &Params, config: &HealthConfig, block: &Block) {
        let mean = &block.mean;
        // Loss of ratio per unit of level.
        let per_level = mean.ratio_per_kou * mean.kou_law;
        let [pressure, temperature] = slope_terms(params, mean);
        let phi = [per_level, mean.ratio, per_level * pressure, per_level * temperature];
        let misfit = config.law_misfit * per_level;
        let random2 = config.ratio_noise * config.ratio_noise * mean.ratio * mean.ratio / block.count as f32;
        let noise_variance = (misfit * misfit + random2) * config.misfit_blocks + 1e-12;

        let hours = self.hours_since(block.time);
        if self.used.is_none() {
            self.begin(params);
        }
        if self.settling > 0 {
            self.average_lever(mean.ratio / per_level);
        }
        self.used = Some(block.time);
        if self.suspect {
            // A sensor, not the machine, has changed: what was learned of the machine stays.
            self.watch_for_recovery(params, config, mean);
        } else {
            let innovation = self.filter.innovation(phi, mean.deficit, noise_variance / config.misfit_blocks);
            let error = innovation.error / per_level;
            let sigma = square_root(innovation.variance) / per_level;
            self.watch_for_step(config, block.time, error, sigma);
            // Forgetting: what wear may bring in the time since the last block, and anything after a step.
            let drift = config.level_drift_per_h;
            self.filter.forget_first(drift * drift * hours, LEVEL_VARIANCE_MAX);
            self.filter.update(phi, mean.deficit, noise_variance);
            self.filter.bound(BOUNDS);
            self.watch_for_drift(config, block.time);
        }
        self.diagnose(params, mean, noise_variance);
        let known = self.diagnosis.blocks() >= JUDGE_BLOCKS;
        self.wear.takes(block.time, known && self.causes.only_leakage() && self.level_above_start(config));
        self.sensor.takes(block.time, known && self.suspect);
        self.trend_blocks = self.trend_blocks.saturating_add(1);
        if self.trend_blocks >= TREND_BLOCKS {
            let [level, ..] = self.filter.theta();
            self.trend_blocks = 0;
            self.trend.takes(1.0 + level, f32::from(TREND_BLOCKS) * config.block_us as f32 / 3.6e9);
        }
    }

    /// What is not known of the sensors before anything was learned.
    fn begin(&mut self, params: &Params) {
        let offset = params.errors.ratio_relative;
        let slope = SLOPE_SD * SLOPE_SD;
        let variances =
            [LEVEL_SD_START * LEVEL_SD_START, (offset * offset).max(OFFSET_VARIANCE_MIN), slope, slope];
        self.filter = UdFilter::new([0.0; PARAMETERS], variances);
    }

    /// Mean lever: slow, so that it stands for where the machine works; quick at first.
    fn average_lever(&mut self, now: f32) {
        let weight = if self.used.is_none() { 1.0 } else { LEVER_WEIGHT };
        self.lever += weight * (now - self.lever);
    }

    /// What is watched: the deficit that the learned parameters predict at the slopes' pivot and at the usual ratio, in
    /// units of level, with its variance. Unlike the level alone it does not depend on how well level and offset can be
    /// told apart, and unlike the deficit itself not on pressure and temperature, which the slopes take.
    fn watched(&self) -> (f32, f32) {
        let phi = [1.0, self.lever, 0.0, 0.0];
        (self.filter.predict(phi), self.filter.innovation(phi, 0.0, 0.0).variance)
    }

    /// Two-sided cumulative sum of the innovations in units of level. The part of an innovation that misfit and what is
    /// not yet learned may cause does not count.
    fn watch_for_step(&mut self, config: &HealthConfig, time: Micros, error: f32, sigma: f32) {
        let allowance = 0.5 * config.report_change + 2.0 * sigma;
        let step = |side: f32| (side * error - allowance).clamp(-SUM_STEP_MAX, SUM_STEP_MAX);
        self.sum_up = (self.sum_up + step(1.0)).max(0.0);
        self.sum_down = (self.sum_down + step(-1.0)).max(0.0);
        if self.is_diagnosing() || (self.sum_up < SUM_LIMIT && self.sum_down < SUM_LIMIT) {
            return;
        }
        let [level, ..] = self.filter.theta();
        self.found(time, level, level + error, true);
        self.filter.forget_first(LEVEL_VARIANCE_MAX, LEVEL_VARIANCE_MAX);
    }

    /// Reports when the slow mean of what is watched has left the reference.
    ///
    /// The reference is the mean over the first hours after the start or after a change, then it stands: a reference that
    /// went on following would follow wear.
    fn watch_for_drift(&mut self, config: &HealthConfig, time: Micros) {
        let (watched, variance) = self.watched();
        if self.settling > 0 {
            self.settling -= 1;
            self.slow = watched;
            self.reference = watched;
            self.reference_blocks = 1;
            return;
        }
        self.slow += SLOW_WEIGHT * (watched - self.slow);
        let distance = self.slow - self.reference;
        // Both means are better than what is watched itself by the number of its time constants that they span.
        let sigma = SLOW_SHARE * square_root(variance);
        if self.is_diagnosing() {
            return;
        }
        if distance.abs() > config.report_change + DRIFT_SIGMAS * sigma {
            let [level, ..] = self.filter.theta();
            self.found(time, level - distance, level, false);
        } else if self.reference_blocks < REFERENCE_BLOCKS {
            self.reference_blocks += 1;
            self.reference += (watched - self.reference) / f32::from(self.reference_blocks);
        }
    }

    /// Whether the last change is too recent for its causes to be judged; until then no other is reported.
    fn is_diagnosing(&self) -> bool {
        self.changes > 0 && self.diagnosis.blocks() < JUDGE_BLOCKS
    }

    /// Ends the suspicion of a sensor when the deficit has been as before the change for long enough.
    fn watch_for_recovery(&mut self, params: &Params, config: &HealthConfig, mean: &Terms) {
        let per_level = mean.ratio_per_kou * mean.kou_law;
        let unexplained = (mean.deficit - self.explained_before(params, mean)) / per_level;
        if unexplained.abs() < config.report_change {
            self.as_before = self.as_before.saturating_add(1);
        } else {
            self.as_before /= 2;
        }
        if self.as_before >= RECOVERY_BLOCKS {
            self.suspect = false;
            self.as_before = 0;
            self.causes = Causes::none();
            self.settling = SETTLE_CHANGE;
        }
    }

    fn found(&mut self, time: Micros, from: f32, to: f32, step: bool) {
        self.changes = self.changes.saturating_add(1);
        self.last_change = Some(Change { time, from: Ratio(1.0 + from), to: Ratio(1.0 + to), step });
        self.before = self.filter.theta();
        let [level, ..] = &mut self.before;
        *level = from;
        self.diagnosis = Diagnosis::new();
        self.causes = Causes::none();
        self.sum_up = 0.0;
        self.sum_down = 0.0;
        self.settling = JUDGE_BLOCKS_U16;
    }

    /// Deficit that was explained by what had been learned before the last change.
    fn explained_before(&self, params: &Params, mean: &Terms) -> f32 {
        let per_level = mean.ratio_per_kou * mean.kou_law;
        let [level, offset, by_pressure, by_temperature] = self.before;
        let [pressure, temperature] = slope_terms(params, mean);
        per_level * (level + by_pressure * pressure + by_temperature * temperature) + mean.ratio * offset
    }

    /// Tells the causes of the last change apart.
    fn diagnose(&mut self, params: &Params, mean: &Terms, noise_variance: f32) {
        if self.changes == 0 {
            return;
        }
        let unexplained = mean.deficit - self.explained_before(params, mean);
        self.diagnosis.takes(&signatures(params, mean), unexplained, noise_variance);
        if self.diagnosis.blocks() < JUDGE_BLOCKS {
            return;
        }
        self.causes = self.diagnosis.remaining();
        if self.causes.no_leakage() && !self.suspect && self.diagnosis.blocks() == JUDGE_BLOCKS {
            self.suspect = true;
            self.as_before = 0;
            self.filter.set_theta(self.before);
        } else if self.suspect && !self.causes.no_leakage() {
            // More operating points have brought leakage back among the causes.
            self.suspect = false;
            self.filter.forget_first(LEVEL_VARIANCE_MAX, LEVEL_VARIANCE_MAX);
            self.settling = SETTLE_CHANGE;
        }
    }

    /// Whether the machine leaks more than when it was calibrated by what is worth a report.
    fn level_above_start(&self, config: &HealthConfig) -> bool {
        let [level, ..] = self.filter.theta();
        level > config.report_change
    }

    fn hours_since(&self, time: Micros) -> f32 {
        let Some(used) = self.used else { return 0.0 };
        // At most a day: a clock that jumped is not a day of wear.
        time.0.saturating_sub(used.0).min(24 * 3_600_000_000) as f32 / 3.6e9
    }

    fn report(&self, health: &HealthParams, time: Micros, gate: Result<(), Closed>) -> Health {
        let [level, offset, ..] = self.filter.theta();
        let [variance, ..] = self.filter.variances();
        // What wear may have changed since the last block that was used.
        let drift = health.config.level_drift_per_h;
        let aged = variance + drift * drift * self.hours_since(time) + health.systematic2;
        Health {
            gate,
            level: Ratio(1.0 + level),
            level_se: Ratio(square_root(aged)),
            ratio_offset: Ratio(offset),
            changes: self.changes,
            causes: self.causes,
            wear: self.wear.stage,
            sensor: self.sensor.stage,
        }
    }
}

/// Normalised pressure and temperature of a block, from the slopes' pivots.
fn slope_terms(params: &Params, mean: &Terms) -> [f32; 2] {
    let [_, y, z] =
        params.law.normalised(RevPerMin(mean.n_p_rpm), Megapascal(mean.p_h_mpa), Celsius(mean.t_b_c));
    let [pressure, temperature] = SLOPE_PIVOTS;
    [y - pressure, z - temperature]
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
