//! The stages in which a block is worked into the learned state, one with each sample that follows it.

use serde::{Deserialize, Serialize};

use super::block::Terms;
use super::gate::Closed;
use super::judge::{Judge, Verdict};
use super::signature::{
    CAUSES, LEAKAGE_SIGNATURES, OTHER_SIGNATURES, joined, signatures_of_leakage, signatures_of_others,
};
use super::state::{HealthState, LEVEL_SD_START};
use super::ud::{PARAMETERS, UdFilter};
use crate::params::Params;
use crate::root::square_root;
use crate::units::{Celsius, Megapascal, RevPerMin};

/// What is to be done with the block that waits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(super) enum Stage {
    /// No block waits.
    Idle,
    /// Are pump speed and pressure steady?
    GateDrive,
    /// Are displacement and the deficit of ratio?
    GateRest,
    /// What does the model say of it?
    Compare,
    /// What do the parameters leave unexplained?
    Innovate,
    /// Is that a step?
    Sum,
    /// It is: take note of the change.
    FoundStep,
    /// Forget a little.
    Forget,
    /// Learn from it.
    Learn,
    /// Has the level drifted?
    Watch,
    /// It has: take note of the change.
    FoundDrift,
    /// Signatures of leakage and of speed sensors, where there was a change.
    SignLeakage,
    /// Signatures of the other causes.
    SignOthers,
    /// Regression on them.
    Regress,
    /// Which causes remain?
    Explain,
    /// What follows from the causes.
    Conclude,
    /// Troubles.
    Count,
    /// Bounds and the trend of the level.
    Follow,
    /// What is to be told.
    Tell,
}

/// What the stages hand to each other.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(super) struct Used {
    /// Loss of ratio per unit of level.
    pub(super) per_level: f32,
    pub(super) phi: [f32; PARAMETERS],
    /// Variance of the deficit's noise, counted as if blocks were independent.
    pub(super) noise_variance: f32,
    /// Deficit that the parameters do not predict, or distance from the reference once a drift is found; what their
    /// uncertainty may have done to it (1 sigma), and the noise's variance, all in units of level.
    pub(super) error: f32,
    pub(super) learned_sd: f32,
    pub(super) noise2: f32,
    /// Judged driving since the block before, in hours.
    pub(super) hours: f32,
    pub(super) of_leakage: [f32; LEAKAGE_SIGNATURES],
    pub(super) of_others: [f32; OTHER_SIGNATURES],
    pub(super) unexplained: f32,
    /// What each cause explains of the deficits since the change, in units of chi-squared.
    pub(super) explained: [f32; CAUSES],
    /// Difference of that from which a cause is ruled out.
    pub(super) ruled_out: f32,
}

impl Used {
    /// No block so far.
    pub(super) const fn new() -> Self {
        Self {
            per_level: 0.0,
            phi: [0.0; PARAMETERS],
            noise_variance: 1.0,
            error: 0.0,
            learned_sd: 0.0,
            noise2: 1.0,
            hours: 0.0,
            of_leakage: [0.0; LEAKAGE_SIGNATURES],
            of_others: [0.0; OTHER_SIGNATURES],
            unexplained: 0.0,
            explained: [0.0; CAUSES],
            ruled_out: 0.0,
        }
    }
}

/// Largest variance of the level: what is known right after a step, that is a standard deviation of 0.3.
const LEVEL_VARIANCE_MAX: f32 = 0.09;
/// Smallest variance of the factor on the ratio: sensors that are declared to be perfect are good to 0.01 %.
const OFFSET_VARIANCE_MIN: f32 = 1e-8;
/// Standard deviation of the slopes of the level with normalised pressure and temperature.
const SLOPE_SD: f32 = 0.15;
/// Bounds of level less 1, ratio offset and slopes.
const BOUNDS: [(f32, f32); PARAMETERS] = [(-0.95, 20.0), (-0.05, 0.05), (-0.6, 0.6), (-0.6, 0.6)];
/// Normalised pressure and temperature about which the slopes turn: the middle of where machines work.
const SLOPE_PIVOTS: [f32; 2] = [0.55, 0.7];
/// Standard error to which what is watched must be learned before changes are judged.
const LEARNED_SD: f32 = 0.02;
/// Variance by which the level is forgotten with each block right after a change, which may still grow: it then follows
/// within some eight blocks.
const SETTLE_VARIANCE: f32 = 1e-4;
/// Blocks between two points of the trend: about five minutes.
const TREND_BLOCKS: u16 = 600;

impl HealthState {
    /// One stage of the block that waits.
    pub(super) fn work(&mut self, params: &Params) {
        self.stage = match self.stage {
            Stage::Idle => return,
            Stage::GateDrive => self.pass_drive(),
            Stage::GateRest => self.pass_rest(),
            Stage::Compare => self.compare(params),
            Stage::Innovate => self.innovate(),
            Stage::Sum => self.sum(params),
            Stage::FoundStep => {
                let [level, ..] = self.filter.theta();
                self.found(params, level, level + self.used.error, true);
                self.filter.forget_first(LEVEL_VARIANCE_MAX, LEVEL_VARIANCE_MAX);
                Stage::Forget
            }
            Stage::Forget => self.forget(params),
            Stage::Learn => {
                self.filter.update(self.used.phi, self.block.mean.deficit, self.used.noise_variance);
                Stage::Watch
            }
            Stage::Watch => self.watch(params),
            Stage::FoundDrift => {
                let [level, ..] = self.filter.theta();
                self.found(params, level - self.used.error, level, false);
                Stage::SignLeakage
            }
            Stage::SignLeakage => self.sign_leakage(params),
            Stage::SignOthers => self.sign_others(params),
            Stage::Regress => self.regress(),
            Stage::Explain => {
                self.used.explained = self.judge.explained();
                self.used.ruled_out = self.judge.ruled_out(1.0 / params.health.config.misfit_blocks);
                Stage::Conclude
            }
            Stage::Conclude => self.conclude(params),
            Stage::Count => self.count(params),
            Stage::Follow => self.follow(params),
            Stage::Tell => {
                self.tell(params, self.block.time);
                Stage::Idle
            }
        };
    }

    #[inline(never)]
    fn pass_drive(&mut self) -> Stage {
        if self.block.after_gap {
            self.gate.restart(&self.block);
            self.told.gate = Err(GateClosed::AfterGap);
            return Stage::Tell;
        }
        self.passed = Ok(());
        let (speed, pressure) = (self.gate.speed(&self.block), self.gate.pressure(&self.block));
        self.pass(speed, GateClosed::SpeedUnsteady);
        self.pass(pressure, GateClosed::PressureUnsteady);
        Stage::GateRest
    }

    #[inline(never)]
    fn pass_rest(&mut self) -> Stage {
        let (displacement, deficit) = (self.gate.displacement(&self.block), self.gate.deficit(&self.block));
        self.pass(displacement, GateClosed::DisplacementUnsteady);
        self.pass(deficit, GateClosed::RatioUnsteady);
        self.told.gate = self.passed;
        if self.passed.is_ok() { Stage::Compare } else { Stage::Tell }
    }

    /// The first reason stands.
    fn pass(&mut self, steady: bool, otherwise: Closed) {
        if !steady && self.passed.is_ok() {
            self.passed = Err(otherwise);
        }
    }

    /// Sets up the model of the block's deficit.
    #[inline(never)]
    fn compare(&mut self, params: &Params) -> Stage {
        if self.used_at.is_none() {
            self.begin(params);
        }
        let config = &params.health.config;
        let mean = &self.block.mean;
        let per_level = mean.ratio_per_kou * mean.kou_law;
        let [pressure, temperature] = slope_terms(params, mean);
        let phi = [per_level, mean.ratio, per_level * pressure, per_level * temperature];
        let misfit = config.law_misfit * per_level;
        let random = config.ratio_noise * mean.ratio;
        // The misfit is one value for as long as the operating point is; random errors are new in every sample.
        let noise_variance =
            misfit * misfit * config.misfit_blocks + random * random / self.block.count as f32 + 1e-12;
        self.used =
            Used { per_level, phi, noise_variance, hours: self.hours_since(self.block.time), ..self.used };
        self.used_at = Some(self.block.time);
        // A sensor, not the machine, has changed: what was learned of the machine stays.
        if self.judge.suspect { Stage::SignLeakage } else { Stage::Innovate }
    }

    #[inline(never)]
    fn innovate(&mut self) -> Stage {
        let used = &mut self.used;
        let innovation = self.filter.innovation(used.phi, self.block.mean.deficit, 0.0);
        let levels = 1.0 / used.per_level;
        used.error = innovation.error * levels;
        used.learned_sd = square_root(innovation.variance) * levels;
        used.noise2 = used.noise_variance * levels * levels;
        Stage::Sum
    }

    /// Looks for a step in what the parameters leave unexplained.
    #[inline(never)]
    fn sum(&mut self, params: &Params) -> Stage {
        let Used { error, noise2, learned_sd, .. } = self.used;
        if self.settling == 0 && self.steps.takes(&params.health.step, error, noise2, learned_sd) {
            Stage::FoundStep
        } else {
            Stage::Forget
        }
    }

    /// Forgets what wear may bring in the time since the last block, and more right after a change.
    #[inline(never)]
    fn forget(&mut self, params: &Params) -> Stage {
        let drift = params.health.config.level_drift_per_h;
        let mut forgotten = drift * drift * self.used.hours;
        if self.judge.changes > 0 && self.settling > params.health.judge_blocks / 2 {
            forgotten += SETTLE_VARIANCE;
        }
        self.filter.forget_first(forgotten, LEVEL_VARIANCE_MAX);
        Stage::Learn
    }

    /// Looks for a drift, or learns what is usual.
    #[inline(never)]
    fn watch(&mut self, params: &Params) -> Stage {
        if self.settling > 0 && self.judge.changes == 0 {
            self.drifts.learn_usual(self.used.phi, self.used.per_level);
        }
        let phi = self.drifts.usual();
        let watched = self.filter.predict(phi);
        let sd = square_root(self.filter.innovation(phi, 0.0, 0.0).variance);
        if self.settling > 0 {
            self.drifts.restart(watched);
            if self.settling > 1 || sd < LEARNED_SD || self.judge.changes > 0 {
                self.settling -= 1;
            }
        } else if let Some(distance) = self.drifts.takes(watched, sd, params.health.config.report_change) {
            self.used.error = distance;
            return Stage::FoundDrift;
        }
        if self.judge.changes == 0 { Stage::Follow } else { Stage::SignLeakage }
    }

    /// What the parameters before the last change leave unexplained, and how each cause would look here.
    #[inline(never)]
    fn sign_leakage(&mut self, params: &Params) -> Stage {
        let [p1, p2, p3, p4] = self.used.phi;
        let [t1, t2, t3, t4] = self.judge.before;
        self.used.unexplained = self.block.mean.deficit - (p1 * t1 + p2 * t2 + p3 * t3 + p4 * t4);
        self.used.of_leakage = signatures_of_leakage(&params.law, &self.block.mean);
        Stage::SignOthers
    }

    #[inline(never)]
    fn sign_others(&mut self, params: &Params) -> Stage {
        self.used.of_others = signatures_of_others(&params.reduced, &params.law, &self.block.mean);
        Stage::Regress
    }

    #[inline(never)]
    fn regress(&mut self) -> Stage {
        let used = &self.used;
        self.judge.regress(&joined(used.of_leakage, used.of_others), used.unexplained, used.noise_variance);
        Stage::Explain
    }

    #[inline(never)]
    fn conclude(&mut self, params: &Params) -> Stage {
        let config = &params.health.config;
        let unexplained = self.used.unexplained / self.used.per_level;
        let judge_blocks = params.health.judge_blocks;
        self.judge.explain(&self.used.explained, self.used.ruled_out, judge_blocks);
        match self.judge.judge(unexplained, config.report_change, judge_blocks) {
            Verdict::Unchanged => {}
            Verdict::SensorSuspected => {
                self.filter.set_theta(self.judge.before);
                self.settling = params.health.settle_blocks;
            }
            Verdict::SensorCleared => {
                self.filter.forget_first(LEVEL_VARIANCE_MAX, LEVEL_VARIANCE_MAX);
                self.settling = params.health.settle_blocks;
            }
        }
        Stage::Count
    }

    #[inline(never)]
    fn count(&mut self, params: &Params) -> Stage {
        let [level, ..] = self.filter.theta();
        let health = &params.health;
        self.judge.count(self.block.time, level > health.config.report_change, health.judge_blocks);
        Stage::Follow
    }

    #[inline(never)]
    fn follow(&mut self, params: &Params) -> Stage {
        self.filter.bound(BOUNDS);
        self.trend_blocks = self.trend_blocks.saturating_add(1);
        if self.trend_blocks >= TREND_BLOCKS {
            let [level, ..] = self.filter.theta();
            self.trend.takes(
                1.0 + level,
                f32::from(self.trend_blocks) * params.health.config.block_us as f32 / 3.6e9,
            );
            self.trend_blocks = 0;
        }
        Stage::Tell
    }

    #[inline(never)]
    fn found(&mut self, params: &Params, from: f32, to: f32, step: bool) {
        let change = Judge::change(self.block.time, from, to, step);
        self.judge.found(change, self.filter.theta(), from);
        self.settling = params.health.judge_blocks;
    }

    /// What is not known of the sensors before anything was learned.
    fn begin(&mut self, params: &Params) {
        let offset = params.errors.ratio_relative;
        let slope = SLOPE_SD * SLOPE_SD;
        let variances =
            [LEVEL_SD_START * LEVEL_SD_START, (offset * offset).max(OFFSET_VARIANCE_MIN), slope, slope];
        self.filter = UdFilter::new([0.0; PARAMETERS], variances);
        self.settling = params.health.settle_blocks;
    }
}

/// Normalised pressure and temperature of a block, from the slopes' pivots.
fn slope_terms(params: &Params, mean: &Terms) -> [f32; 2] {
    let [_, y, z] =
        params.law.normalised(RevPerMin(mean.n_p_rpm), Megapascal(mean.p_h_mpa), Celsius(mean.t_b_c));
    let [pressure, temperature] = SLOPE_PIVOTS;
    [y - pressure, z - temperature]
}
