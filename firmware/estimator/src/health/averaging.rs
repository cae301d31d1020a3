//! Block averaging: means over a fixed time, slower than the piston ripple and less noisy than single samples.
//!
//! The averaged quantities are by-products of the step, so a block costs no second flow balance. Within a steady block
//! they vary little, so that means of products equal products of means; unsteady blocks are not used.

use serde::{Deserialize, Serialize};

use super::tuning::MAX_GAP_BLOCKS;
use crate::units::Micros;

/// Contribution of one sample to the regression of the ratio residual; of a block, the means.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct RegressionSample {
    /// Ratio residual: ratio expected by the law minus measured ratio, both as magnitudes. Positive when more leaks
    /// than the law expects.
    pub ratio_residual: f32,
    /// Sensitivity `|dr/dKou|`: loss of ratio per (L/min)/MPa.
    pub ratio_per_kou: f32,
    /// Kou by the law, (L/min)/MPa.
    pub kou_law: f32,
    /// Measured ratio, magnitude.
    pub ratio: f32,
    /// Pump speed, r/min.
    pub n_p_rpm: f32,
    /// High pressure, MPa gauge.
    pub p_h_mpa: f32,
    /// Oil temperature, degC.
    pub t_b_c: f32,
    /// Displacement fraction, magnitude.
    pub alpha: f32,
    /// Compression loss `chi`.
    pub chi: f32,
}

impl RegressionSample {
    /// Zero in every field.
    pub const ZERO: Self = Self {
        ratio_residual: 0.0,
        ratio_per_kou: 0.0,
        kou_law: 0.0,
        ratio: 0.0,
        n_p_rpm: 0.0,
        p_h_mpa: 0.0,
        t_b_c: 0.0,
        alpha: 0.0,
        chi: 0.0,
    };

    /// Applies a function to every field and its counterpart.
    #[inline(always)]
    fn zip_with(&self, other: &Self, f: impl Fn(f32, f32) -> f32) -> Self {
        Self {
            ratio_residual: f(self.ratio_residual, other.ratio_residual),
            ratio_per_kou: f(self.ratio_per_kou, other.ratio_per_kou),
            kou_law: f(self.kou_law, other.kou_law),
            ratio: f(self.ratio, other.ratio),
            n_p_rpm: f(self.n_p_rpm, other.n_p_rpm),
            p_h_mpa: f(self.p_h_mpa, other.p_h_mpa),
            t_b_c: f(self.t_b_c, other.t_b_c),
            alpha: f(self.alpha, other.alpha),
            chi: f(self.chi, other.chi),
        }
    }
}

/// Sums of the block being filled.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Accumulator {
    sums: RegressionSample,
    count: u32,
    begin: Micros,
    last: Micros,
    after_gap: bool,
}

/// A full block: means over its samples.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Block {
    /// Time of its last sample.
    pub time: Micros,
    /// Means.
    pub mean: RegressionSample,
    /// Number of samples.
    pub count: u32,
    /// Whether a gap in the samples separates it from the block before.
    pub after_gap: bool,
}

impl Block {
    /// Empty block.
    #[must_use]
    pub const fn new() -> Self {
        Self { time: Micros(0), mean: RegressionSample::ZERO, count: 0, after_gap: false }
    }
}

impl Accumulator {
    /// Empty accumulator.
    #[must_use]
    pub const fn new() -> Self {
        Self::since(Micros(0))
    }

    /// Empty accumulator whose first block begins at a time.
    #[must_use]
    pub const fn since(time: Micros) -> Self {
        Self { sums: RegressionSample::ZERO, count: 0, begin: time, last: time, after_gap: false }
    }

    /// Discards the samples since the last block.
    pub fn clear(&mut self) {
        self.count = 0;
    }

    /// Adds a sample; true when the block is full. The first sample after a gap begins a new block, marked as such.
    #[inline(always)]
    pub fn push(&mut self, time: Micros, sample: &RegressionSample, block_us: u32) -> bool {
        let gap = time.0.saturating_sub(self.last.0) > MAX_GAP_BLOCKS * u64::from(block_us);
        if self.count == 0 || gap {
            self.sums = *sample;
            self.count = 0;
            self.begin = self.last;
            self.after_gap = gap;
        } else {
            // A block has some hundred samples at most, so plain sums keep six digits.
            self.sums = self.sums.zip_with(sample, |sum, value| sum + value);
        }
        self.count = self.count.saturating_add(1);
        self.last = time;
        time.0.saturating_sub(self.begin.0) >= u64::from(block_us)
    }

    /// Closes the block and begins the next.
    pub fn take_block(&mut self) -> Block {
        let per_count = 1.0 / self.count.max(1) as f32;
        let block = Block {
            time: self.last,
            mean: self.sums.zip_with(&RegressionSample::ZERO, |sum, _| sum * per_count),
            count: self.count,
            after_gap: self.after_gap,
        };
        self.count = 0;
        block
    }
}
