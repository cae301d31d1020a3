//! Drifts of the level: the distance of a slow mean from a reference that was learned and then stands.
//!
//! What is watched is the deficit that the learned parameters predict at the usual operating point, in units of level. Unlike
//! the level alone it does not depend on how well level, offset and slopes can be told apart, and unlike the deficit itself
//! not on the present operating point. What is usual is fixed with the reference: a lever of the offset that moved with the
//! load would turn a learned offset of the ratio into changes of the level.

use serde::{Deserialize, Serialize};

use super::ud_rls::PARAMETERS;

/// Blocks over which the reference is averaged: some two hours of driving.
const REFERENCE_BLOCKS: u16 = 4000;
/// Weight of a block in the slow mean of what is watched.
const SLOW_WEIGHT: f32 = 1.0 / 200.0;
/// Weight of a block in what is usual, once the first has been taken.
const USUAL_WEIGHT: f32 = 1.0 / 64.0;
/// Standard errors by which it must have left the reference, beside the change that is worth a report.
const SIGMAS: f32 = 2.0;

/// Slow mean, reference and the operating point that both stand for.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DriftWatch {
    reference: f32,
    reference_blocks: u16,
    slow: f32,
    /// What a unit of each parameter amounts to at the usual operating point, in units of level.
    usual: [f32; PARAMETERS],
}

impl DriftWatch {
    /// Nothing learned yet.
    pub const fn new() -> Self {
        Self { reference: 0.0, reference_blocks: 0, slow: 0.0, usual: [0.0; PARAMETERS] }
    }

    /// What a unit of each parameter amounts to at the usual operating point, in units of level.
    pub const fn usual(&self) -> [f32; PARAMETERS] {
        self.usual
    }

    /// While the reference is still being learned: takes the operating point of a block.
    pub fn learn_usual(&mut self, phi: [f32; PARAMETERS], per_level: f32) {
        let [level, ..] = self.usual;
        let weight = if level > 0.0 { USUAL_WEIGHT } else { 1.0 };
        let levels = 1.0 / per_level;
        for (mean, now) in self.usual.iter_mut().zip(phi) {
            *mean += weight * (now * levels - *mean);
        }
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Distance at which a drift is reported, and the blocks that it took; none within 20 000.
    fn reported(per_block: f32, end: f32, sd: f32) -> Option<(f32, u32)> {
        let mut watch = DriftWatch::new();
        watch.restart(0.0);
        (0..4000).for_each(|_| assert_eq!(watch.takes(0.0, sd, 0.05), None));
        let level = |i: u32| (per_block * i as f32).min(end);
        (0..20_000).find_map(|i| Some((watch.takes(level(i), sd, 0.05)?, i)))
    }

    #[test]
    fn drift_is_reported_beyond_the_change_worth_a_report_and_two_standard_errors() {
        // 5 % and twice 1 %. The slow mean lags by 200 blocks, and meets the threshold from below.
        let (distance, _) = reported(1e-5, 1.0, 0.01).unwrap();
        assert!((0.07..0.0702).contains(&distance), "{distance}");
        assert_eq!(reported(1e-5, 0.069, 0.01), None);
    }
}
