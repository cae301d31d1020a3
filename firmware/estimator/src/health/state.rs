//! The learned state: what it holds, what it tells, and how samples get into it.
//!
//! A sample is added to the block being filled. When a block is full it waits for its stages (`stages`), one with each of
//! the following samples, while the next one fills; a block that is full before its predecessor is done goes on filling.
//! So a slow sample rate makes longer blocks, and no sample costs more than one stage.

use serde::{Deserialize, Serialize};

use super::block::{Accumulator, Block, Terms};
use super::config::Severity;
use super::drift_watch::DriftWatch;
use super::gate::{Closed, Gate};
use super::judge::Judge;
use super::stages::{Stage, Used};
use super::step_watch::StepWatch;
use super::trend::{Remaining, Slope, Trend};
use super::trouble::Trouble;
use super::ud::{PARAMETERS, UdFilter};
use super::{Change, Health};
use crate::estimate::Reason;
use crate::params::Params;
use crate::root::square_root;
use crate::units::{Micros, Ratio};

/// What changes. At most 1 KiB; `Clone` and the saved form keep every bit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct HealthState {
    pub(super) accumulator: Accumulator,
    pub(super) stage: Stage,
    pub(super) block: Block,
    pub(super) used: Used,
    pub(super) gate: Gate,
    /// What the gate said of the block that waits.
    pub(super) passed: Result<(), GateClosed>,
    pub(super) filter: UdFilter,
    pub(super) steps: StepWatch,
    pub(super) drifts: DriftWatch,
    pub(super) judge: Judge,
    /// Blocks for which neither steps nor drifts are judged: after the start and after a change.
    pub(super) settling: u16,
    /// Time of the last block that was used.
    pub(super) used_at: Option<Micros>,
    pub(super) trend: Trend,
    pub(super) trend_blocks: u16,
    pub(super) told: Health,
}

/// Standard deviation of the level before anything was learned: the machine may have worn since it was calibrated.
pub(super) const LEVEL_SD_START: f32 = 0.3;

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
            stage: Stage::Idle,
            block: Block::new(),
            used: Used::new(),
            gate: Gate::new(),
            passed: Err(GateClosed::Filling),
            filter: UdFilter::new([0.0; PARAMETERS], [LEVEL_SD_START * LEVEL_SD_START; PARAMETERS]),
            steps: StepWatch::new(),
            drifts: DriftWatch::new(),
            judge: Judge::new(),
            settling: 0,
            used_at: None,
            trend: Trend::new(),
            trend_blocks: 0,
            told: Health::new(),
        }
    }

    /// The last change that was reported.
    #[must_use]
    pub fn last_change(&self) -> Option<LevelChange> {
        self.judge.last
    }

    /// The trouble "leaks more than it did", with its history.
    #[must_use]
    pub fn wear(&self) -> &Trouble {
        &self.judge.wear
    }

    /// The trouble "a sensor or the oil explains a change", with its history.
    #[must_use]
    pub fn sensor(&self) -> &Trouble {
        &self.judge.sensor
    }

    /// Time until the limit of the calibration, once a trend is known.
    #[must_use]
    pub fn remaining(&self, params: &Params) -> Option<Remaining> {
        self.trend.remaining(self.told.level, params.health.config.limit_level)
    }

    /// Slope of the level over hours of judged driving, once a trend is known.
    #[must_use]
    pub fn slope(&self) -> Option<Slope> {
        self.trend.slope()
    }

    /// What the level means at the rated point of the calibration.
    #[must_use]
    pub fn severity(&self, params: &Params) -> Severity {
        params.health.severity(self.told.level)
    }

    /// Whether every number is finite and the covariance positive definite: a state that was saved sound is sound.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        let numbers = [self.told.level.get(), self.told.level_se.get(), self.told.ratio_offset.get()];
        self.filter.is_sound() && numbers.iter().all(|n| n.is_finite())
    }

    /// What is known after the last sample.
    #[inline(always)]
    pub(crate) fn told(&self) -> Health {
        self.told
    }

    /// Takes a sample that has no valid terms.
    #[inline(never)]
    pub(crate) fn skip(&mut self, params: &Params, time: Micros, reason: Reason) {
        self.work(params);
        if reason == Reason::TimeReversed {
            self.accumulator = Accumulator::since(time);
        } else {
            self.accumulator.clear();
        }
        self.told.gate = Err(GateClosed::Sample(reason));
        self.tell(params, time);
    }

    /// Takes the terms of a valid sample.
    #[inline(always)]
    pub(crate) fn takes(&mut self, params: &Params, time: Micros, terms: &Terms) {
        self.work(params);
        let block_us = params.health.config.block_us;
        let full = self.accumulator.takes(time, terms, block_us);
        if full && self.stage == Stage::Idle {
            self.block = self.accumulator.block();
            self.stage = Stage::GateDrive;
        }
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
    pub(super) fn tell(&mut self, params: &Params, time: Micros) {
        let [level, offset, ..] = self.filter.theta();
        let [variance, ..] = self.filter.variances();
        // What wear may have changed since the last block that was used.
        let drift = params.health.config.level_drift_per_h;
        let aged = variance
            + drift * drift * self.hours_since(time)
            + params.health.systematic_variance(1.0 + level);
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
}
