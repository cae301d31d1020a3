//! Drifts of the level: the distance of a slow mean from a reference that was learned and then stands.
//!
//! What is watched is `level + lever * offset`: the deficit that the learned parameters predict at the slopes' pivot and at
//! the usual ratio, in units of level. Unlike the level alone it does not depend on how well level and offset can be told
//! apart, and unlike the deficit itself not on pressure and temperature, which the slopes take. The lever is fixed with
//! the reference: one that moved with the load would turn a learned offset of the ratio into changes of the level.

use serde::{Deserialize, Serialize};

/// Blocks over which the reference is averaged: some two hours of driving.
const REFERENCE_BLOCKS: u16 = 4000;
/// Weight of a block in the slow mean of what is watched.
const SLOW_WEIGHT: f32 = 1.0 / 200.0;
/// Weight of a block in the mean lever.
const LEVER_WEIGHT: f32 = 1.0 / 512.0;
/// Standard errors by which it must have left the reference, beside the change that is worth a report.
const SIGMAS: f32 = 2.0;

/// Slow mean, reference and the lever that both were formed with.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DriftWatch {
    reference: f32,
    reference_blocks: u16,
    slow: f32,
    /// Mean of what a unit of ratio offset amounts to, in units of level.
    lever: f32,
}

impl DriftWatch {
    /// Nothing learned yet.
    pub const fn new() -> Self {
        Self { reference: 0.0, reference_blocks: 0, slow: 0.0, lever: 0.0 }
    }

    /// Lever that offsets are weighed with.
    pub const fn lever(&self) -> f32 {
        self.lever
    }

    /// While the reference is still being learned: takes the lever of a block.
    pub fn learn_lever(&mut self, now: f32) {
        let weight = if self.lever > 0.0 { LEVER_WEIGHT } else { 1.0 };
        self.lever += weight * (now - self.lever);
    }

    /// Starts the reference anew at what is watched now.
    pub fn restart(&mut self, watched: f32) {
        self.slow = watched;
        self.reference = watched;
        self.reference_blocks = 1;
    }

    /// Takes what is watched after a block, and the variance of it. Returns the distance from the reference when it is
    /// to be reported.
    pub fn takes(&mut self, watched: f32, sd: f32, report_change: f32) -> Option<f32> {
        self.slow += SLOW_WEIGHT * (watched - self.slow);
        let distance = self.slow - self.reference;
        if distance.abs() > report_change + SIGMAS * sd {
            return Some(distance);
        }
        if self.reference_blocks < REFERENCE_BLOCKS {
            self.reference_blocks += 1;
            self.reference += (watched - self.reference) / f32::from(self.reference_blocks);
        }
        None
    }
}
