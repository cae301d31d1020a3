//! The stages in which a block is worked into the learned state, one with each sample that follows it.

use super::averaging::{Accumulator, Terms};
use super::block_update::{Stage, Used};
use super::context::HealthContext;
use super::diagnosis::{Judge, Verdict};
use super::fault_isolation::{joined, signatures_of_leakage, signatures_of_others};
use super::state::HealthState;
use super::status::Health;
use super::steady_gate::Closed;
use super::tuning::LEVEL_SD_START;
use super::ud_rls::{PARAMETERS, UdFilter};
use crate::model::sqrt::square_root;
use crate::reason::Reason;
use crate::units::{Celsius, Megapascal, Micros, Ratio, RevPerMin};

/// Largest variance of the level: what is known right after a step, that is a standard deviation of 0.3.
const LEVEL_VARIANCE_MAX: f32 = 0.09;
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
    /// Takes a sample that has no valid terms.
    #[inline(never)]
    pub(crate) fn skip(&mut self, context: HealthContext<'_>, time: Micros, reason: Reason) {
        self.work(context);
        if reason == Reason::TimeReversed {
            self.accumulator = Accumulator::since(time);
        } else {
            self.accumulator.clear();
        }
        self.told.gate = Err(GateClosed::Sample(reason));
        self.tell(context, time);
    }

    /// Takes the terms of a valid sample.
    #[inline(always)]
    pub(crate) fn takes(&mut self, context: HealthContext<'_>, time: Micros, terms: &Terms) {
        self.work(context);
        let block_us = context.params.config.block_us;
        let full = self.accumulator.takes(time, terms, block_us);
        if full && self.stage == Stage::Idle {
            self.block = self.accumulator.block();
            self.stage = Stage::GateDrive;
        }
    }

    /// One stage of the block that waits.
    pub(super) fn work(&mut self, context: HealthContext<'_>) {
        self.stage = match self.stage {
            Stage::Idle => return,
            Stage::GateDrive => self.pass_drive(),
            Stage::GateRest => self.pass_rest(),
            Stage::Compare => self.compare(context),
            Stage::Innovate => self.innovate(),
            Stage::Sum => self.sum(context),
            Stage::FoundStep => {
                let [level, ..] = self.filter.theta();
                self.found(context, level, level + self.used.error, true);
                self.filter.forget_first(LEVEL_VARIANCE_MAX, LEVEL_VARIANCE_MAX);
                Stage::Forget
            }
            Stage::Forget => self.forget(context),
            Stage::Learn => {
                self.filter.update(self.used.phi, self.block.mean.deficit, self.used.noise_variance);
                Stage::Watch
            }
            Stage::Watch => self.watch(context),
            Stage::FoundDrift => {
                let [level, ..] = self.filter.theta();
                self.found(context, level - self.used.error, level, false);
                Stage::SignLeakage
            }
            Stage::SignLeakage => self.sign_leakage(context),
            Stage::SignOthers => self.sign_others(context),
            Stage::Regress => self.regress(),
            Stage::Explain => {
                self.used.explained = self.judge.explained();
                self.used.ruled_out = self.judge.ruled_out(1.0 / context.params.config.misfit_blocks);
                Stage::Conclude
            }
            Stage::Conclude => self.conclude(context),
            Stage::Count => self.count(context),
            Stage::Follow => self.follow(context),
            Stage::Tell => {
                self.tell(context, self.block.time);
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
    fn compare(&mut self, context: HealthContext<'_>) -> Stage {
        if self.used_at.is_none() {
            self.begin(context);
        }
        let config = &context.params.config;
        let mean = &self.block.mean;
        let per_level = mean.ratio_per_kou * mean.kou_law;
        let [pressure, temperature] = slope_terms(context, mean);
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
    fn sum(&mut self, context: HealthContext<'_>) -> Stage {
        let Used { error, noise2, learned_sd, .. } = self.used;
        if self.settling == 0 && self.steps.takes(&context.params.step, error, noise2, learned_sd) {
            Stage::FoundStep
        } else {
            Stage::Forget
        }
    }

    /// Forgets what wear may bring in the time since the last block, and more right after a change.
    #[inline(never)]
    fn forget(&mut self, context: HealthContext<'_>) -> Stage {
        let drift = context.params.config.level_drift_per_h;
        let mut forgotten = drift * drift * self.used.hours;
        if self.judge.changes > 0 && self.settling > context.params.judge_blocks / 2 {
            forgotten += SETTLE_VARIANCE;
        }
        self.filter.forget_first(forgotten, LEVEL_VARIANCE_MAX);
        Stage::Learn
    }

    /// Looks for a drift, or learns what is usual.
    #[inline(never)]
    fn watch(&mut self, context: HealthContext<'_>) -> Stage {
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
        } else if let Some(distance) = self.drifts.takes(watched, sd, context.params.config.report_change) {
            self.used.error = distance;
            return Stage::FoundDrift;
        }
        if self.judge.changes == 0 { Stage::Follow } else { Stage::SignLeakage }
    }

    /// What the parameters before the last change leave unexplained, and how each cause would look here.
    #[inline(never)]
    fn sign_leakage(&mut self, context: HealthContext<'_>) -> Stage {
        let [p1, p2, p3, p4] = self.used.phi;
        let [t1, t2, t3, t4] = self.judge.before;
        self.used.unexplained = self.block.mean.deficit - (p1 * t1 + p2 * t2 + p3 * t3 + p4 * t4);
        self.used.of_leakage = signatures_of_leakage(&context.model.law, &self.block.mean);
        Stage::SignOthers
    }

    #[inline(never)]
    fn sign_others(&mut self, context: HealthContext<'_>) -> Stage {
        self.used.of_others =
            signatures_of_others(&context.model.reduced, &context.model.law, &self.block.mean);
        Stage::Regress
    }

    #[inline(never)]
    fn regress(&mut self) -> Stage {
        let used = &self.used;
        self.judge.regress(&joined(used.of_leakage, used.of_others), used.unexplained, used.noise_variance);
        Stage::Explain
    }

    #[inline(never)]
    fn conclude(&mut self, context: HealthContext<'_>) -> Stage {
        let config = &context.params.config;
        let unexplained = self.used.unexplained / self.used.per_level;
        let judge_blocks = context.params.judge_blocks;
        self.judge.explain(&self.used.explained, self.used.ruled_out, judge_blocks);
        match self.judge.judge(unexplained, config.report_change, judge_blocks) {
            Verdict::Unchanged => {}
            Verdict::SensorSuspected => {
                self.filter.set_theta(self.judge.before);
                self.settling = context.params.settle_blocks;
            }
            Verdict::SensorCleared => {
                self.filter.forget_first(LEVEL_VARIANCE_MAX, LEVEL_VARIANCE_MAX);
                self.settling = context.params.settle_blocks;
            }
        }
        Stage::Count
    }

    #[inline(never)]
    fn count(&mut self, context: HealthContext<'_>) -> Stage {
        let [level, ..] = self.filter.theta();
        let health = context.params;
        self.judge.count(self.block.time, level > health.config.report_change, health.judge_blocks);
        Stage::Follow
    }

    #[inline(never)]
    fn follow(&mut self, context: HealthContext<'_>) -> Stage {
        self.filter.bound(BOUNDS);
        self.trend_blocks = self.trend_blocks.saturating_add(1);
        if self.trend_blocks >= TREND_BLOCKS {
            let [level, ..] = self.filter.theta();
            self.trend.takes(
                1.0 + level,
                f32::from(self.trend_blocks) * context.params.config.block_us as f32 / 3.6e9,
            );
            self.trend_blocks = 0;
        }
        Stage::Tell
    }

    #[inline(never)]
    fn found(&mut self, context: HealthContext<'_>, from: f32, to: f32, step: bool) {
        let change = Judge::change(self.block.time, from, to, step);
        self.judge.found(change, self.filter.theta(), from);
        self.settling = context.params.judge_blocks;
    }

    pub(super) fn hours_since(&self, time: Micros) -> f32 {
        let Some(used) = self.used_at else { return 0.0 };
        // At most a day: a clock that jumped is not a day of wear.
        let units = time.0.saturating_sub(used.0).min(24 * 3_600_000_000) >> 10;
        // In units of 1.024 ms a day fits 32 bits, which the processor converts by itself.
        units as u32 as f32 * (1.024e-3 / 3600.0)
    }

    /// Puts into words what is known at a time.
    #[inline(never)]
    pub(super) fn tell(&mut self, context: HealthContext<'_>, time: Micros) {
        let [level, offset, ..] = self.filter.theta();
        let [variance, ..] = self.filter.variances();
        // What wear may have changed since the last block that was used.
        let drift = context.params.config.level_drift_per_h;
        let aged = variance
            + drift * drift * self.hours_since(time)
            + context.params.systematic_variance(1.0 + level);
        self.told = Health {
            gate: self.told.gate,
            level: Ratio(1.0 + level),
            level_se: Ratio(square_root(aged)),
            ratio_offset: Ratio(offset),
            changes: self.judge.changes,
            causes: self.judge.causes,
            wear: self.judge.wear.stage,
            sensor: self.judge.sensor.stage,
        };
    }

    /// What is not known of the sensors before anything was learned.
    fn begin(&mut self, context: HealthContext<'_>) {
        let slope = SLOPE_SD * SLOPE_SD;
        let variances = [LEVEL_SD_START * LEVEL_SD_START, context.params.offset_variance, slope, slope];
        self.filter = UdFilter::new([0.0; PARAMETERS], variances);
        self.settling = context.params.settle_blocks;
    }
}

/// Normalised pressure and temperature of a block, from the slopes' pivots.
fn slope_terms(context: HealthContext<'_>, mean: &Terms) -> [f32; 2] {
    let [_, y, z] =
        context.model.law.normalised(RevPerMin(mean.n_p_rpm), Megapascal(mean.p_h_mpa), Celsius(mean.t_b_c));
    let [pressure, temperature] = SLOPE_PIVOTS;
    [y - pressure, z - temperature]
}
