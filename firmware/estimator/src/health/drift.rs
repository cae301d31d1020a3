//! Detection of drifts: distance of a slow mean from a learned reference that then stays fixed.
//!
//! The monitored quantity is the ratio residual that the learned parameters predict at the reference operating point,
//! in units of level. Unlike the level alone it does not depend on how well level, offset and slopes can be separated,
//! and unlike the residual itself not on the present operating point. The reference regressor is fixed with the
//! reference: a lever of the offset that moved with the load would turn a learned offset of the ratio into apparent
//! changes of the level.

use serde::{Deserialize, Serialize};

use super::tuning::{DRIFT_SIGMAS, REFERENCE_BLOCKS, REGRESSOR_WEIGHT, SLOW_WEIGHT};
use super::ud_rls::PARAMETERS;

/// Slow mean, reference, and the regressor at which both are predicted.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DriftDetector {
    reference: f32,
    reference_blocks: u16,
    slow: f32,
    /// Regressor at the reference operating point, in units of level per unit of each parameter.
    reference_regressor: [f32; PARAMETERS],
}

impl DriftDetector {
    /// Detector before the first block.
    pub const fn new() -> Self {
        Self { reference: 0.0, reference_blocks: 0, slow: 0.0, reference_regressor: [0.0; PARAMETERS] }
    }

    /// Regressor at the reference operating point, in units of level per unit of each parameter.
    pub const fn reference_regressor(&self) -> [f32; PARAMETERS] {
        self.reference_regressor
    }

    /// Averages the regressor of a block into the reference regressor, during the hold-off after the start.
    pub fn learn_regressor(&mut self, phi: [f32; PARAMETERS], per_level: f32) {
        let [level, ..] = self.reference_regressor;
        let weight = if level > 0.0 { REGRESSOR_WEIGHT } else { 1.0 };
        let levels = 1.0 / per_level;
        for (mean, now) in self.reference_regressor.iter_mut().zip(phi) {
            *mean += weight * (now * levels - *mean);
        }
    }

    /// Restarts reference and slow mean at the present prediction.
    pub fn restart(&mut self, predicted: f32) {
        self.slow = predicted;
        self.reference = predicted;
        self.reference_blocks = 1;
    }

    /// Updates with the prediction after a block and its standard deviation `sd`. Returns the distance from the
    /// reference once a drift is to be reported.
    pub fn update(&mut self, predicted: f32, sd: f32, report_change: f32) -> Option<f32> {
        self.slow += SLOW_WEIGHT * (predicted - self.slow);
        let distance = self.slow - self.reference;
        if distance.abs() > report_change + DRIFT_SIGMAS * sd {
            return Some(distance);
        }
        if self.reference_blocks < REFERENCE_BLOCKS {
            self.reference_blocks += 1;
            self.reference += (predicted - self.reference) / f32::from(self.reference_blocks);
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Distance at which a drift is reported, and the blocks that it took; none within 20 000.
    fn reported(per_block: f32, end: f32, sd: f32) -> Option<(f32, u32)> {
        let mut detector = DriftDetector::new();
        detector.restart(0.0);
        (0..4000).for_each(|_| assert_eq!(detector.update(0.0, sd, 0.05), None));
        let level = |i: u32| (per_block * i as f32).min(end);
        (0..20_000).find_map(|i| Some((detector.update(level(i), sd, 0.05)?, i)))
    }

    #[test]
    fn drift_is_reported_beyond_the_change_worth_a_report_and_two_standard_errors() {
        // 5 % and twice 1 %. The slow mean lags by 200 blocks, and meets the threshold from below.
        let (distance, _) = reported(1e-5, 1.0, 0.01).unwrap();
        assert!((0.07..0.0702).contains(&distance), "{distance}");
        assert_eq!(reported(1e-5, 0.069, 0.01), None);
    }
}
