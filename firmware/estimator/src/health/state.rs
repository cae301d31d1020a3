//! Learned state of health monitoring.

use serde::{Deserialize, Serialize};

use super::averaging::{Accumulator, Block};
use super::block_update::{BlockUpdate, ProcessingStage};
use super::cusum::Cusum;
use super::diagnosis::Diagnosis;
use super::drift::DriftDetector;
use super::fault_debounce::DiagnosticFault;
use super::params::{HealthParams, Severity};
use super::prognosis::{LevelTrend, RemainingLife, Slope};
use super::status::{Health, LevelChange};
use super::steady_gate::{GateClosed, SteadyGate};
use super::tuning::LEVEL_SD_START;
use super::ud_rls::{PARAMETERS, UdFilter};
use crate::units::Micros;

/// Learned state: at most 1 KiB; `Clone` and the saved form preserve every bit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct HealthState {
    pub(super) accumulator: Accumulator,
    pub(super) stage: ProcessingStage,
    /// Block that is pending.
    pub(super) block: Block,
    pub(super) pending: BlockUpdate,
    pub(super) gate: SteadyGate,
    /// Whether the gate admits the pending block.
    pub(super) admitted: Result<(), GateClosed>,
    pub(super) filter: UdFilter,
    pub(super) cusum: Cusum,
    pub(super) drift: DriftDetector,
    pub(super) diagnosis: Diagnosis,
    /// Remaining blocks without tests for steps and drifts: after the start and after a change.
    pub(super) holdoff_blocks: u16,
    /// Time of the last used block.
    pub(super) used_at: Option<Micros>,
    pub(super) trend: LevelTrend,
    pub(super) trend_blocks: u16,
    pub(super) status: Health,
}

impl Default for HealthState {
    fn default() -> Self {
        Self::new()
    }
}

impl HealthState {
    /// State of a machine as calibrated.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            accumulator: Accumulator::new(),
            stage: ProcessingStage::Idle,
            block: Block::new(),
            pending: BlockUpdate::new(),
            gate: SteadyGate::new(),
            admitted: Err(GateClosed::Filling),
            filter: UdFilter::new([0.0; PARAMETERS], [LEVEL_SD_START * LEVEL_SD_START; PARAMETERS]),
            cusum: Cusum::new(),
            drift: DriftDetector::new(),
            diagnosis: Diagnosis::new(),
            holdoff_blocks: 0,
            used_at: None,
            trend: LevelTrend::new(),
            trend_blocks: 0,
            status: Health::new(),
        }
    }

    /// The last change that was reported.
    #[must_use]
    pub fn last_change(&self) -> Option<LevelChange> {
        self.diagnosis.last
    }

    /// Diagnostic fault "wear" with its history.
    #[must_use]
    pub fn wear(&self) -> &DiagnosticFault {
        &self.diagnosis.wear
    }

    /// Diagnostic fault "sensor" with its history.
    #[must_use]
    pub fn sensor(&self) -> &DiagnosticFault {
        &self.diagnosis.sensor
    }

    /// Remaining life until the calibration's limit of the level, once a trend is known.
    #[must_use]
    pub fn remaining_life(&self, params: &HealthParams) -> Option<RemainingLife> {
        self.trend.remaining_life(self.status.level, params.config.limit_level)
    }

    /// Slope of the level over hours of driving with the gate open, once a trend is known.
    #[must_use]
    pub fn slope(&self) -> Option<Slope> {
        self.trend.slope()
    }

    /// Severity of the level at the calibration's rated point.
    #[must_use]
    pub fn severity(&self, params: &HealthParams) -> Severity {
        params.severity(self.status.level)
    }

    /// Whether every number is finite and the covariance positive definite, as in every state that was saved undamaged.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        let numbers = [self.status.level.get(), self.status.level_se.get(), self.status.ratio_offset.get()];
        self.filter.is_sound() && numbers.iter().all(|n| n.is_finite())
    }

    /// Health status after the last sample.
    #[inline(always)]
    pub(crate) fn status(&self) -> Health {
        self.status
    }
}
