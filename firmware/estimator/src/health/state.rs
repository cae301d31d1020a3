//! The learned state: what it holds, what it tells, and how samples get into it.
//!
//! A sample is added to the block being filled. When a block is full it waits for its stages (`stages`), one with each of
//! the following samples, while the next one fills; a block that is full before its predecessor is done goes on filling.
//! So a slow sample rate makes longer blocks, and no sample costs more than one stage.

use serde::{Deserialize, Serialize};

use super::averaging::{Accumulator, Block};
use super::block_update::{Stage, Used};
use super::cusum::StepWatch;
use super::diagnosis::Judge;
use super::drift::DriftWatch;
use super::fault_debounce::Trouble;
use super::params::{HealthParams, Severity};
use super::prognosis::{Remaining, Slope, Trend};
use super::status::{Change, Health};
use super::steady_gate::{Closed, Gate};
use super::tuning::LEVEL_SD_START;
use super::ud_rls::{PARAMETERS, UdFilter};
use crate::units::Micros;

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
    pub fn remaining(&self, params: &HealthParams) -> Option<Remaining> {
        self.trend.remaining(self.told.level, params.config.limit_level)
    }

    /// Slope of the level over hours of judged driving, once a trend is known.
    #[must_use]
    pub fn slope(&self) -> Option<Slope> {
        self.trend.slope()
    }

    /// What the level means at the rated point of the calibration.
    #[must_use]
    pub fn severity(&self, params: &HealthParams) -> Severity {
        params.severity(self.told.level)
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
}
