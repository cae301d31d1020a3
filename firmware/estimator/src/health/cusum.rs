//! Detection of steps by a two-sided cumulative sum of log-likelihood ratios (CUSUM; Page 1954).
//!
//! The hypothesis "the level has changed by `mu`" is tested against "unchanged", with `mu` twice the change worth a
//! report, so that the sum rises only for changes above the latter. Per block, with innovation `e` and noise variance
//! `v`:
//!
//! ```text
//! S := max(0, S + mu (|e| - mu/2 - 2 s_e)/v)
//! ```
//!
//! `s_e` is the standard error of `e` by the learned parameters. The variance of a block is multiplied by the number of
//! blocks that share one misfit, since only so many blocks are one independent decision. A sum of independent
//! log-likelihood ratios reaches a threshold `h` by chance after `exp(h)` decisions at the earliest on average (Lorden
//! 1971), so `h` follows from the stated false-alarm interval (average run length to a false alarm, ARL0). Derived in
//! `docs/health/theory.md`.

use serde::{Deserialize, Serialize};

use super::tuning::{CUSUM_LIMIT_MIN, DESIGN_CHANGES, LEARNED_SIGMAS, PLATEAU_BLOCKS_MIN, PLATEAU_LIMITS};
use crate::calibration::HealthConfig;

/// Thresholds that follow from the configuration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CusumThresholds {
    /// Threshold `h` at which a step is reported.
    limit: f32,
    /// Largest contribution of one block.
    largest: f32,
    /// Change `mu` for which the sum is optimal, in units of level.
    design: f32,
}

impl CusumThresholds {
    /// Thresholds for a checked configuration.
    pub fn new(config: &HealthConfig) -> Self {
        let block_h = config.block_us as f32 / 3.6e9;
        let decisions = config.false_alarm_interval_h / (block_h * config.misfit_blocks);
        // Both sides together.
        let limit = libm::logf(2.0 * decisions).max(CUSUM_LIMIT_MIN);
        Self {
            limit,
            largest: PLATEAU_LIMITS * limit / config.misfit_blocks.max(PLATEAU_BLOCKS_MIN),
            design: DESIGN_CHANGES * config.report_change,
        }
    }
}

/// Two-sided cumulative sum.
#[doc(alias = "CUSUM")]
#[doc(alias = "cumulative sum")]
#[doc(alias = "Page test")]
#[doc(alias = "Page-Hinkley")]
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Cusum {
    up: f32,
    down: f32,
}

impl Cusum {
    /// Sums at zero.
    pub const fn new() -> Self {
        Self { up: 0.0, down: 0.0 }
    }

    /// Updates the sums with a block; true when a step is to be reported, after which the sums restart at zero.
    ///
    /// `error` is the block's innovation, `noise2` its noise variance per decision, and `learned_sd` the standard error
    /// of the prediction by the learned parameters, all in units of level.
    pub fn update(&mut self, thresholds: &CusumThresholds, error: f32, noise2: f32, learned_sd: f32) -> bool {
        let scale = thresholds.design / noise2;
        let allowance = 0.5 * thresholds.design + LEARNED_SIGMAS * learned_sd;
        let largest = thresholds.largest;
        // Not `clamp`, which panics on NaN bounds.
        let contribution = |side: f32| (scale * (side * error - allowance)).max(-largest).min(largest);
        let non_negative = |sum: f32| if sum > 0.0 { sum } else { 0.0 };
        self.up = non_negative(self.up + contribution(1.0));
        self.down = non_negative(self.down + contribution(-1.0));
        let found = self.up >= thresholds.limit || self.down >= thresholds.limit;
        if found {
            *self = Self::new();
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Uniform noise whose standard deviation is 1, the same in every run.
    fn noise(state: &mut u64) -> f32 {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((*state >> 40) as f32 / 16_777_216.0 - 0.5) * 3.464_101_6
    }

    /// Blocks until a report, with a misfit that stays the same for fifteen blocks; at most `longest`.
    fn blocks_until_report(interval_h: f32, mean: f32, misfit: f32, longest: u32) -> u32 {
        let thresholds = CusumThresholds::new(&HealthConfig {
            false_alarm_interval_h: interval_h,
            ..HealthConfig::DEFAULT
        });
        let (mut cusum, mut state, mut held) = (Cusum::new(), 1, 0.0);
        for i in 0..longest {
            if i % 15 == 0 {
                held = misfit * noise(&mut state);
            }
            if cusum.update(&thresholds, mean + held, 15.0 * 0.02 * 0.02, 0.0) {
                return i;
            }
        }
        longest
    }

    #[test]
    fn val_false_alarm_interval_is_at_least_the_stated_one_although_blocks_share_their_misfit() {
        // One hour is 480 decisions of fifteen blocks. At the smallest change that must not be reported, half of the
        // design change, the sum has no drift; noise alone must not report it in the stated time.
        assert_eq!(blocks_until_report(1000.0, 0.0, 0.02, 1000 * 7200), 1000 * 7200);
    }

    #[test]
    fn change_worth_a_report_is_found_within_a_minute_and_a_wild_block_alone_never() {
        // Twice the change that is worth a report: h = 18 at (0.1 - 0.05)*0.1/0.006 = 0.83 per block are 22 blocks.
        assert!((15..60).contains(&blocks_until_report(1e5, 0.1, 0.02, 10_000)));
        let thresholds = CusumThresholds::new(&HealthConfig::DEFAULT);
        let mut cusum = Cusum::new();
        assert!(!cusum.update(&thresholds, 1e9, 0.006, 0.0));
        assert!(!(0..1000).any(|_| cusum.update(&thresholds, 0.0, 0.006, 0.0)));
    }
}
