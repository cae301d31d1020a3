//! Steps of the level: a two-sided cumulative sum of log-likelihood ratios (Page 1954).
//!
//! Against "nothing changed" stands "the level has changed by twice what is worth a report", so that the sum rises only
//! for changes above what is worth a report. A block's part is divided by the number of blocks that share one misfit, since
//! only so many blocks are one decision. A sum of independent log-likelihood ratios reaches `h` by chance after `exp(h)`
//! decisions at the earliest on average (Lorden 1971), so `h` follows from the stated run length. `docs/health/theory.md`.

use serde::{Deserialize, Serialize};

use crate::calibration::HealthConfig;

/// What follows from the settings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepThresholds {
    /// Sum at which a step is reported.
    limit: f32,
    /// Largest part of one block: half of the blocks of a plateau must agree before anything is reported.
    largest: f32,
    /// Change for which the sum is the best, in units of level.
    design: f32,
}

impl StepThresholds {
    /// Thresholds of checked settings.
    pub fn new(config: &HealthConfig) -> Self {
        let block_h = config.block_us as f32 / 3.6e9;
        let decisions = config.run_length_h / (block_h * config.misfit_blocks);
        // Both sides together; at least e^3, below which it would answer to single plateaus.
        let limit = libm::logf(2.0 * decisions).max(3.0);
        Self {
            limit,
            largest: 2.0 * limit / config.misfit_blocks.max(4.0),
            design: 2.0 * config.report_change,
        }
    }
}

/// The sums upwards and downwards.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct StepWatch {
    up: f32,
    down: f32,
}

impl StepWatch {
    /// Nothing summed yet.
    pub const fn new() -> Self {
        Self { up: 0.0, down: 0.0 }
    }

    /// Takes a block: its innovation, that innovation's noise variance per decision, and what the uncertainty of the
    /// learned parameters may have done to it (1 sigma), all in units of level. True when a step is to be reported; the
    /// sums then start anew.
    pub fn takes(&mut self, thresholds: &StepThresholds, error: f32, noise2: f32, learned_sd: f32) -> bool {
        let scale = thresholds.design / noise2;
        let allowance = 0.5 * thresholds.design + 2.0 * learned_sd;
        let most = thresholds.largest;
        // Not `clamp`, which panics on bounds that are no numbers.
        let part = |side: f32| (scale * (side * error - allowance)).max(-most).min(most);
        let summed = |sum: f32| if sum > 0.0 { sum } else { 0.0 };
        self.up = summed(self.up + part(1.0));
        self.down = summed(self.down + part(-1.0));
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
    use crate::units::{Celsius, Megapascal, Ratio, RevPerMin};

    fn config() -> HealthConfig {
        HealthConfig {
            block_us: 500_000,
            law_misfit: 0.02,
            misfit_blocks: 15.0,
            ratio_noise: 7e-4,
            level_drift_per_h: 0.01,
            report_change: 0.05,
            run_length_h: 1e5,
            limit_level: Ratio(2.0),
            rated_speed: RevPerMin(2000.0),
            rated_pressure: Megapascal(35.0),
            rated_temperature: Celsius(60.0),
        }
    }

    /// Uniform noise whose standard deviation is 1, the same in every run.
    fn noise(state: &mut u64) -> f32 {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((*state >> 40) as f32 / 16_777_216.0 - 0.5) * 3.464_101_6
    }

    /// Blocks until a report, with a misfit that stays the same for fifteen blocks; at most `longest`.
    fn run(limit_h: f32, mean: f32, misfit: f32, longest: u32) -> u32 {
        let thresholds = StepThresholds::new(&HealthConfig { run_length_h: limit_h, ..config() });
        let (mut watch, mut state, mut held) = (StepWatch::new(), 1, 0.0);
        for i in 0..longest {
            if i % 15 == 0 {
                held = misfit * noise(&mut state);
            }
            if watch.takes(&thresholds, mean + held, 15.0 * 0.02 * 0.02, 0.0) {
                return i;
            }
        }
        longest
    }

    #[test]
    fn val_run_length_is_at_least_the_stated_one_although_blocks_share_their_misfit() {
        // One hour is 480 decisions of fifteen blocks. At the smallest change that must not be reported, half of the
        // design change, the sum has no drift; noise alone must not report it in the stated time.
        assert_eq!(run(1000.0, 0.0, 0.02, 1000 * 7200), 1000 * 7200);
    }

    #[test]
    fn change_worth_a_report_is_found_within_a_minute_and_a_wild_block_alone_never() {
        // Twice the change that is worth a report: h = 18 at (0.1 - 0.05)*0.1/0.006 = 0.83 per block are 22 blocks.
        assert!((15..60).contains(&run(1e5, 0.1, 0.02, 10_000)));
        let thresholds = StepThresholds::new(&config());
        let mut watch = StepWatch::new();
        assert!(!watch.takes(&thresholds, 1e9, 0.006, 0.0));
        assert!(!(0..1000).any(|_| watch.takes(&thresholds, 0.0, 0.006, 0.0)));
    }
}
