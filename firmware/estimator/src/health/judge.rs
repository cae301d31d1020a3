//! What follows a change: its causes, the suspicion of a sensor, and the troubles that are told to people.

use serde::{Deserialize, Serialize};

use super::Change;
use super::signature::{CAUSES, Causes, Diagnosis, remaining, ruled_out_after};
use super::trouble::Trouble;
use super::ud::PARAMETERS;
use crate::units::{Micros, Ratio};

/// Blocks as before the change that end the suspicion of a sensor: some minutes.
const RECOVERY_BLOCKS: u16 = 300;

/// What the causes mean for the learned state.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// Nothing new.
    Unchanged,
    /// A sensor, not the machine, has changed: what was learned before the change holds again.
    SensorSuspected,
    /// More operating points have brought leakage back among the causes.
    SensorCleared,
}

/// The last change, and what has been made of it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Judge {
    pub changes: u16,
    pub last: Option<LevelChange>,
    /// Parameters before the last change, against which its causes are told apart.
    pub before: [f32; PARAMETERS],
    diagnosis: Diagnosis,
    pub causes: Causes,
    pub suspect: bool,
    /// Blocks, while a sensor is suspected, in which the deficit was as before the change.
    as_before: u16,
    pub wear: Trouble,
    pub sensor: Trouble,
}

impl Judge {
    /// No change so far.
    pub const fn new() -> Self {
        Self {
            changes: 0,
            last: None,
            before: [0.0; PARAMETERS],
            diagnosis: Diagnosis::new(),
            causes: Causes::none(),
            suspect: false,
            as_before: 0,
            wear: Trouble::new(),
            sensor: Trouble::new(),
        }
    }

    /// Takes note of a change; `theta` are the parameters at that time, of which the first was `from` before.
    pub fn found(&mut self, change: Change, theta: [f32; PARAMETERS], from: f32) {
        self.changes = self.changes.saturating_add(1);
        self.last = Some(change);
        self.before = theta;
        let [level, ..] = &mut self.before;
        *level = from;
        self.diagnosis = Diagnosis::new();
        self.causes = Causes::none();
    }

    /// A change at a time.
    pub fn change(time: Micros, from: f32, to: f32, step: bool) -> Change {
        Change { time, from: Ratio(1.0 + from), to: Ratio(1.0 + to), step }
    }

    /// Takes the deficit of a block that the parameters before the change leave unexplained.
    #[inline(never)]
    pub fn regress(&mut self, signatures: &[f32; CAUSES], unexplained: f32, noise_variance: f32) {
        self.diagnosis.takes(signatures, unexplained, noise_variance);
    }

    /// What each cause explains so far.
    #[inline(never)]
    pub fn explained(&self) -> [f32; CAUSES] {
        self.diagnosis.explained()
    }

    /// Difference in fit from which a cause is ruled out by now; a block is `per_block` decisions.
    pub fn ruled_out(&self, per_block: f32) -> f32 {
        ruled_out_after(per_block * self.diagnosis.weight())
    }

    /// Finds the causes that remain, once `judge_blocks` blocks have been taken.
    pub fn explain(&mut self, explained: &[f32; CAUSES], ruled_out: f32, judge_blocks: u16) {
        if self.diagnosis.blocks() >= u32::from(judge_blocks) {
            self.causes = remaining(explained, ruled_out);
        }
    }

    /// Judges what the causes mean after a block; `unexplained_level` is that block's deficit in units of level, `judge_blocks` the
    /// number of blocks from which causes are judged.
    pub fn judge(&mut self, unexplained_level: f32, report_change: f32, judge_blocks: u16) -> Verdict {
        if self.changes == 0 {
            return Verdict::Unchanged;
        }
        if self.suspect && self.recovered(unexplained_level, report_change) {
            self.suspect = false;
            self.causes = Causes::none();
            return Verdict::SensorSuspected;
        }
        if self.diagnosis.blocks() < u32::from(judge_blocks) {
            return Verdict::Unchanged;
        }
        if self.causes.no_leakage() && !self.suspect {
            self.suspect = true;
            self.as_before = 0;
            return Verdict::SensorSuspected;
        }
        if self.suspect && !self.causes.no_leakage() {
            self.suspect = false;
            return Verdict::SensorCleared;
        }
        Verdict::Unchanged
    }

    /// Whether the deficit has been as before the change for long enough to end the suspicion of a sensor.
    fn recovered(&mut self, unexplained_level: f32, report_change: f32) -> bool {
        if unexplained_level.abs() < report_change {
            self.as_before = self.as_before.saturating_add(1);
        } else {
            self.as_before /= 2;
        }
        self.as_before >= RECOVERY_BLOCKS
    }

    /// Counts a block for or against each trouble; `level_up` when the machine leaks more than when it was calibrated.
    pub fn count(&mut self, time: Micros, level_up: bool, judge_blocks: u16) {
        let known = self.diagnosis.blocks() >= u32::from(judge_blocks);
        self.wear.takes(time, known && self.causes.only_leakage() && level_up);
        self.sensor.takes(time, known && self.suspect);
    }
}
