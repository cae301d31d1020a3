//! Diagnosis after a detected change: possible causes, suspicion of a sensor, and the debounced diagnostic faults.

use serde::{Deserialize, Serialize};

use super::fault_debounce::DiagnosticFault;
use super::fault_isolation::{CAUSE_COUNT, CauseRegression, Causes, exclusion_threshold, possible_causes};
use super::status::LevelChange;
use super::tuning::RECOVERY_BLOCKS;
use super::ud_rls::PARAMETERS;
use crate::units::Micros;

/// Consequence of the possible causes for the learned parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ParameterAction {
    /// As before.
    Unchanged,
    /// The parameters before the change hold again: a sensor, not the machine, has changed, or a suspected one has
    /// recovered.
    RestoreParameters,
    /// The level may change: more operating points have brought leakage back among the causes.
    ReleaseLevel,
}

/// Share of the residuals since the last change that each cause explains, and the limit below which a cause is excluded.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CauseEvidence {
    /// Reduction of chi-squared by each cause.
    pub explained: [f32; CAUSE_COUNT],
    /// Difference of that from the best cause at which a cause is excluded.
    pub threshold: f32,
}

impl CauseEvidence {
    /// Evidence before the first change.
    pub const fn new() -> Self {
        Self { explained: [0.0; CAUSE_COUNT], threshold: 0.0 }
    }
}

/// Diagnosis of the last change.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Diagnosis {
    /// Number of changes so far.
    pub changes: u16,
    /// The last change.
    pub last: Option<LevelChange>,
    /// Parameters before the last change, against which its causes are isolated.
    pub before: [f32; PARAMETERS],
    regression: CauseRegression,
    /// Causes that remain possible.
    pub causes: Causes,
    /// Whether a sensor is suspected.
    pub suspect: bool,
    /// Blocks, while a sensor is suspected, in which the residual was as before the change.
    as_before: u16,
    /// Diagnostic fault "wear".
    pub wear: DiagnosticFault,
    /// Diagnostic fault "sensor".
    pub sensor: DiagnosticFault,
}

impl Diagnosis {
    /// Diagnosis without a change.
    pub const fn new() -> Self {
        Self {
            changes: 0,
            last: None,
            before: [0.0; PARAMETERS],
            regression: CauseRegression::new(),
            causes: Causes::none(),
            suspect: false,
            as_before: 0,
            wear: DiagnosticFault::new(),
            sensor: DiagnosticFault::new(),
        }
    }

    /// Starts the diagnosis of a change; `theta` are the parameters at that time, of which the first was
    /// `level_before`.
    pub fn start(&mut self, change: LevelChange, theta: [f32; PARAMETERS], level_before: f32) {
        self.changes = self.changes.saturating_add(1);
        self.last = Some(change);
        self.before = theta;
        let [level, ..] = &mut self.before;
        *level = level_before;
        self.regression = CauseRegression::new();
        self.causes = Causes::none();
    }

    /// Adds a block: its signatures, the residual that the parameters before the change leave, and its noise variance.
    #[inline(never)]
    pub fn push(&mut self, signatures: &[f32; CAUSE_COUNT], unexplained: f32, noise_variance: f32) {
        self.regression.push(signatures, unexplained, noise_variance);
    }

    /// Reduction of chi-squared by each cause so far.
    #[inline(never)]
    pub fn explained(&self) -> [f32; CAUSE_COUNT] {
        self.regression.explained()
    }

    /// Present exclusion threshold; a block is `per_block` decisions.
    pub fn threshold(&self, per_block: f32) -> f32 {
        exclusion_threshold(per_block * self.regression.weight())
    }

    /// Updates the possible causes, once `diagnosis_blocks` blocks have been added.
    pub fn update_causes(&mut self, evidence: &CauseEvidence, diagnosis_blocks: u16) {
        if self.regression.blocks() >= u32::from(diagnosis_blocks) {
            self.causes = possible_causes(&evidence.explained, evidence.threshold);
        }
    }

    /// Updates the suspicion of a sensor after a block; `unexplained_level` is that block's residual in units of level,
    /// `diagnosis_blocks` the number of blocks from which causes are isolated.
    pub fn update_suspicion(
        &mut self,
        unexplained_level: f32,
        report_change: f32,
        diagnosis_blocks: u16,
    ) -> ParameterAction {
        if self.changes == 0 {
            return ParameterAction::Unchanged;
        }
        if self.suspect && self.recovered(unexplained_level, report_change) {
            self.suspect = false;
            self.causes = Causes::none();
            return ParameterAction::RestoreParameters;
        }
        if self.regression.blocks() < u32::from(diagnosis_blocks) {
            return ParameterAction::Unchanged;
        }
        if self.causes.no_leakage() && !self.suspect {
            self.suspect = true;
            self.as_before = 0;
            return ParameterAction::RestoreParameters;
        }
        if self.suspect && !self.causes.no_leakage() {
            self.suspect = false;
            return ParameterAction::ReleaseLevel;
        }
        ParameterAction::Unchanged
    }

    /// Whether the residual has been as before the change for long enough to end the suspicion of a sensor.
    fn recovered(&mut self, unexplained_level: f32, report_change: f32) -> bool {
        if unexplained_level.abs() < report_change {
            self.as_before = self.as_before.saturating_add(1);
        } else {
            self.as_before /= 2;
        }
        self.as_before >= RECOVERY_BLOCKS
    }

    /// Counts a block for or against both faults; `level_up` when the machine leaks more than when it was calibrated.
    pub fn debounce(&mut self, time: Micros, level_up: bool, diagnosis_blocks: u16) {
        let known = self.regression.blocks() >= u32::from(diagnosis_blocks);
        self.wear.update(time, known && self.causes.only_leakage() && level_up);
        self.sensor.update(time, known && self.suspect);
    }
}
