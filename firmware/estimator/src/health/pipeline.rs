//! Processing pipeline: how samples become blocks and blocks update the learned state.
//!
//! A sample is added to the block being filled. A full block becomes pending and is processed by one stage with each of
//! the following samples, while the next block fills; a block that is full while another is pending goes on filling. So
//! a slow sample rate makes longer blocks, and no sample costs more than one stage. What a stage produces is stored as
//! a typed hand-off in [`BlockUpdate`](super::block_update::BlockUpdate).

use super::averaging::{Accumulator, RegressionSample};
use super::block_regression::BlockRegression;
use super::block_update::ProcessingStage as Stage;
use super::context::HealthContext;
use super::diagnosis::{CauseEvidence, ParameterAction};
use super::fault_isolation::{all_signatures, leakage_signatures, other_signatures};
use super::state::HealthState;
use super::status::{Health, LevelChange};
use super::steady_gate::GateClosed;
use super::tuning::{
    HOLDOFF_VARIANCE, LEARNED_SD, LEVEL_SD_START, LEVEL_VARIANCE_MAX, MAX_PAUSE_US, PARAMETER_BOUNDS,
    SLOPE_SD, TREND_BLOCKS,
};
use super::ud_rls::{PARAMETERS, UdFilter};
use crate::model::sqrt::square_root;
use crate::reason::Reason;
use crate::units::{Micros, Ratio};

impl HealthState {
    /// Records a sample without a valid ratio residual.
    #[inline(never)]
    pub(crate) fn skip(&mut self, context: &HealthContext, time: Micros, reason: Reason) {
        self.process(context);
        if reason == Reason::TimeReversed {
            self.accumulator = Accumulator::since(time);
        } else {
            self.accumulator.clear();
        }
        self.status.gate = Err(GateClosed::Sample(reason));
        self.publish(context, time);
    }

    /// Updates the state with a valid sample.
    #[inline(always)]
    pub(crate) fn update(&mut self, context: &HealthContext, time: Micros, sample: &RegressionSample) {
        self.process(context);
        let block_us = context.params.config.block_us;
        let full = self.accumulator.push(time, sample, block_us);
        if full && self.stage == Stage::Idle {
            self.block = self.accumulator.take_block();
            self.stage = Stage::GateDrive;
        }
    }

    /// Runs one stage of the pending block.
    fn process(&mut self, context: &HealthContext) {
        self.stage = match self.stage {
            Stage::Idle => return,
            Stage::GateDrive => self.gate_drive(),
            Stage::GateRatio => self.gate_ratio(),
            Stage::Compare => self.compare(context),
            Stage::Innovate => self.innovate(),
            Stage::TestStep => self.test_step(context),
            Stage::ReportStep => {
                let [level, ..] = self.filter.theta();
                self.start_diagnosis(context, level, level + self.pending.deviation, true);
                self.filter.forget_first(LEVEL_VARIANCE_MAX, LEVEL_VARIANCE_MAX);
                Stage::Forget
            }
            Stage::Forget => self.forget(context),
            Stage::Learn => {
                let BlockRegression { phi, noise_variance, .. } = self.pending.regression;
                self.filter.update(phi, self.block.mean.ratio_residual, noise_variance);
                Stage::TestDrift
            }
            Stage::TestDrift => self.test_drift(context),
            Stage::ReportDrift => {
                let [level, ..] = self.filter.theta();
                self.start_diagnosis(context, level - self.pending.deviation, level, false);
                Stage::SignLeakage
            }
            Stage::SignLeakage => self.sign_leakage(context),
            Stage::SignOthers => self.sign_others(context),
            Stage::Regress => self.regress(),
            Stage::Weigh => {
                self.pending.evidence = CauseEvidence {
                    explained: self.diagnosis.explained(),
                    threshold: self.diagnosis.threshold(1.0 / context.params.config.misfit_blocks),
                };
                Stage::Conclude
            }
            Stage::Conclude => self.conclude(context),
            Stage::Debounce => self.debounce(context),
            Stage::Extrapolate => self.extrapolate(context),
            Stage::Publish => {
                self.publish(context, self.block.time);
                Stage::Idle
            }
        };
    }

    #[inline(never)]
    fn gate_drive(&mut self) -> Stage {
        if self.block.after_gap {
            self.gate.restart(&self.block);
            self.status.gate = Err(GateClosed::AfterGap);
            return Stage::Publish;
        }
        self.admitted = Ok(());
        let (speed, pressure) = (self.gate.speed(&self.block), self.gate.pressure(&self.block));
        self.require(speed, GateClosed::SpeedUnsteady);
        self.require(pressure, GateClosed::PressureUnsteady);
        Stage::GateRatio
    }

    #[inline(never)]
    fn gate_ratio(&mut self) -> Stage {
        let (displacement, ratio) =
            (self.gate.displacement(&self.block), self.gate.ratio_residual(&self.block));
        self.require(displacement, GateClosed::DisplacementUnsteady);
        self.require(ratio, GateClosed::RatioUnsteady);
        self.status.gate = self.admitted;
        if self.admitted.is_ok() { Stage::Compare } else { Stage::Publish }
    }

    /// Keeps the first reason for which the gate is closed.
    fn require(&mut self, steady: bool, otherwise: GateClosed) {
        if !steady && self.admitted.is_ok() {
            self.admitted = Err(otherwise);
        }
    }

    /// Sets up the regression model of the block.
    #[inline(never)]
    fn compare(&mut self, context: &HealthContext) -> Stage {
        if self.used_at.is_none() {
            self.start(context);
        }
        self.pending.regression = BlockRegression::of(context, &self.block);
        self.pending.hours = self.hours_since(self.block.time);
        self.used_at = Some(self.block.time);
        // A sensor, not the machine, has changed: the learned parameters stay.
        if self.diagnosis.suspect { Stage::SignLeakage } else { Stage::Innovate }
    }

    #[inline(never)]
    fn innovate(&mut self) -> Stage {
        (self.pending.deviation, self.pending.spread) =
            self.pending.regression.innovation(&self.filter, self.block.mean.ratio_residual);
        Stage::TestStep
    }

    /// Tests the innovation for a step.
    #[inline(never)]
    fn test_step(&mut self, context: &HealthContext) -> Stage {
        let (deviation, spread) = (self.pending.deviation, self.pending.spread);
        let thresholds = &context.params.cusum;
        if self.holdoff_blocks == 0
            && self.cusum.update(thresholds, deviation, spread.noise2, spread.learned_sd)
        {
            Stage::ReportStep
        } else {
            Stage::Forget
        }
    }

    /// Forgets what wear may change in the time since the last block, and more right after a change.
    #[inline(never)]
    fn forget(&mut self, context: &HealthContext) -> Stage {
        let drift = context.params.config.level_drift_per_h;
        let mut forgotten = drift * drift * self.pending.hours;
        if self.diagnosis.changes > 0 && self.holdoff_blocks > context.params.diagnosis_blocks / 2 {
            forgotten += HOLDOFF_VARIANCE;
        }
        self.filter.forget_first(forgotten, LEVEL_VARIANCE_MAX);
        Stage::Learn
    }

    /// Tests the learned parameters for a drift; during the hold-off restarts the reference.
    #[inline(never)]
    fn test_drift(&mut self, context: &HealthContext) -> Stage {
        if self.holdoff_blocks > 0 && self.diagnosis.changes == 0 {
            let BlockRegression { phi, per_level, .. } = self.pending.regression;
            self.drift.learn_regressor(phi, per_level);
        }
        let phi = self.drift.reference_regressor();
        let predicted = self.filter.predict(phi);
        let sd = square_root(self.filter.innovation(phi, 0.0, 0.0).variance);
        if self.holdoff_blocks > 0 {
            self.drift.restart(predicted);
            if self.holdoff_blocks > 1 || sd < LEARNED_SD || self.diagnosis.changes > 0 {
                self.holdoff_blocks -= 1;
            }
        } else if let Some(distance) = self.drift.update(predicted, sd, context.params.config.report_change) {
            self.pending.deviation = distance;
            return Stage::ReportDrift;
        }
        if self.diagnosis.changes == 0 { Stage::Extrapolate } else { Stage::SignLeakage }
    }

    /// Residual that the parameters before the last change leave, and the first signatures.
    #[inline(never)]
    fn sign_leakage(&mut self, context: &HealthContext) -> Stage {
        self.pending.unexplained =
            self.pending.regression.unexplained(self.diagnosis.before, self.block.mean.ratio_residual);
        self.pending.leakage_signatures = leakage_signatures(&context.law, &self.block.mean);
        Stage::SignOthers
    }

    #[inline(never)]
    fn sign_others(&mut self, context: &HealthContext) -> Stage {
        self.pending.other_signatures = other_signatures(&context.reduced, &context.law, &self.block.mean);
        Stage::Regress
    }

    #[inline(never)]
    fn regress(&mut self) -> Stage {
        let pending = &self.pending;
        let signatures = all_signatures(pending.leakage_signatures, pending.other_signatures);
        self.diagnosis.push(&signatures, pending.unexplained, pending.regression.noise_variance);
        Stage::Weigh
    }

    #[inline(never)]
    fn conclude(&mut self, context: &HealthContext) -> Stage {
        let unexplained_level = self.pending.unexplained / self.pending.regression.per_level;
        let params = &context.params;
        self.diagnosis.update_causes(&self.pending.evidence, params.diagnosis_blocks);
        let report_change = params.config.report_change;
        match self.diagnosis.update_suspicion(unexplained_level, report_change, params.diagnosis_blocks) {
            ParameterAction::Unchanged => {}
            ParameterAction::RestoreParameters => {
                self.filter.set_theta(self.diagnosis.before);
                self.holdoff_blocks = params.start_holdoff_blocks;
            }
            ParameterAction::ReleaseLevel => {
                self.filter.forget_first(LEVEL_VARIANCE_MAX, LEVEL_VARIANCE_MAX);
                self.holdoff_blocks = params.start_holdoff_blocks;
            }
        }
        Stage::Debounce
    }

    #[inline(never)]
    fn debounce(&mut self, context: &HealthContext) -> Stage {
        let [level, ..] = self.filter.theta();
        let params = &context.params;
        self.diagnosis.debounce(
            self.block.time,
            level > params.config.report_change,
            params.diagnosis_blocks,
        );
        Stage::Extrapolate
    }

    #[inline(never)]
    fn extrapolate(&mut self, context: &HealthContext) -> Stage {
        self.filter.clamp(PARAMETER_BOUNDS);
        self.trend_blocks = self.trend_blocks.saturating_add(1);
        if self.trend_blocks >= TREND_BLOCKS {
            let [level, ..] = self.filter.theta();
            self.trend.push(
                1.0 + level,
                f32::from(self.trend_blocks) * context.params.config.block_us as f32 / 3.6e9,
            );
            self.trend_blocks = 0;
        }
        Stage::Publish
    }

    #[inline(never)]
    fn start_diagnosis(&mut self, context: &HealthContext, from: f32, to: f32, step: bool) {
        let change =
            LevelChange { time: self.block.time, from: Ratio(1.0 + from), to: Ratio(1.0 + to), step };
        self.diagnosis.start(change, self.filter.theta(), from);
        self.holdoff_blocks = context.params.diagnosis_blocks;
    }

    /// Initialises the filter with the prior uncertainty of level, sensors and slopes.
    fn start(&mut self, context: &HealthContext) {
        let slope = SLOPE_SD * SLOPE_SD;
        let variances = [LEVEL_SD_START * LEVEL_SD_START, context.params.offset_variance, slope, slope];
        self.filter = UdFilter::new([0.0; PARAMETERS], variances);
        self.holdoff_blocks = context.params.start_holdoff_blocks;
    }

    /// Driving since the last used block, in hours.
    fn hours_since(&self, time: Micros) -> f32 {
        let Some(used) = self.used_at else { return 0.0 };
        let units = time.0.saturating_sub(used.0).min(MAX_PAUSE_US) >> 10;
        // In units of 1.024 ms a day fits 32 bits, which the processor converts by itself.
        units as u32 as f32 * (1.024e-3 / 3600.0)
    }

    /// Publishes the health status at a time.
    #[inline(never)]
    fn publish(&mut self, context: &HealthContext, time: Micros) {
        let [level, offset, ..] = self.filter.theta();
        let [variance, ..] = self.filter.variances();
        // What wear may have changed since the last used block.
        let drift = context.params.config.level_drift_per_h;
        let aged = variance
            + drift * drift * self.hours_since(time)
            + context.params.systematic_variance(1.0 + level);
        self.status = Health {
            gate: self.status.gate,
            level: Ratio(1.0 + level),
            level_se: Ratio(square_root(aged)),
            ratio_offset: Ratio(offset),
            changes: self.diagnosis.changes,
            causes: self.diagnosis.causes,
            wear: self.diagnosis.wear.status,
            sensor: self.diagnosis.sensor.status,
        };
    }
}
