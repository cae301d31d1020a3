//! Blocks: means over a fixed time, below the piston ripple and above the noise of single samples.
//!
//! What is averaged is what the step has computed already, so a block costs no second flow balance. Within a steady block
//! all of it varies little, and means of products are products of means; blocks that are not steady are not used.

use serde::{Deserialize, Serialize};

use crate::units::Micros;

/// Longest time without a sample within one block, in blocks.
const MAX_GAP_BLOCKS: u64 = 4;

/// What one sample contributes, and what a block holds as means.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Terms {
    /// Ratio by the law minus measured ratio, both as magnitudes: positive when more leaks than the law expects.
    pub deficit: f32,
    /// `dr/dKou` as a magnitude: loss of ratio per (L/min)/MPa.
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
    /// Displacement, magnitude.
    pub alpha: f32,
    /// Lost fraction of compression.
    pub chi: f32,
}

impl Terms {
    /// Nothing.
    pub const NONE: Self = Self {
        deficit: 0.0,
        ratio_per_kou: 0.0,
        kou_law: 0.0,
        ratio: 0.0,
        n_p_rpm: 0.0,
        p_h_mpa: 0.0,
        t_b_c: 0.0,
        alpha: 0.0,
        chi: 0.0,
    };

    /// Each of them by a function of it and its like.
    #[inline(always)]
    fn with(&self, other: &Self, f: impl Fn(f32, f32) -> f32) -> Self {
        Self {
            deficit: f(self.deficit, other.deficit),
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

/// A block being filled.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Accumulator {
    sums: Terms,
    count: u32,
    begin: Micros,
    last: Micros,
    after_gap: bool,
}

/// Means over a block.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Block {
    /// Time of its last sample.
    pub time: Micros,
    /// Means.
    pub mean: Terms,
    /// Number of samples.
    pub count: u32,
    /// Whether samples were missing for so long before it that it has nothing to do with the block before.
    pub after_gap: bool,
}

impl Block {
    /// A block of nothing, in the place of one that is to come.
    #[must_use]
    pub const fn new() -> Self {
        Self { time: Micros(0), mean: Terms::NONE, count: 0, after_gap: false }
    }
}

impl Accumulator {
    /// Nothing collected yet.
    #[must_use]
    pub const fn new() -> Self {
        Self::since(Micros(0))
    }

    /// Nothing collected since a time.
    #[must_use]
    pub const fn since(time: Micros) -> Self {
        Self { sums: Terms::NONE, count: 0, begin: time, last: time, after_gap: false }
    }

    /// Throws away what has been collected since the last block.
    pub fn clear(&mut self) {
        self.count = 0;
    }

    /// Takes a sample; true when the block is full. The first sample after a gap begins a new block, which says so.
    #[inline(always)]
    pub fn takes(&mut self, time: Micros, terms: &Terms, block_us: u32) -> bool {
        let gap = time.0.saturating_sub(self.last.0) > MAX_GAP_BLOCKS * u64::from(block_us);
        if self.count == 0 || gap {
            self.sums = *terms;
            self.count = 0;
            self.begin = self.last;
            self.after_gap = gap;
        } else {
            // A block has some hundred samples at most, so plain sums keep six digits.
            self.sums = self.sums.with(terms, |sum, value| sum + value);
        }
        self.count = self.count.saturating_add(1);
        self.last = time;
        time.0.saturating_sub(self.begin.0) >= u64::from(block_us)
    }

    /// The block that is full; the next begins.
    pub fn block(&mut self) -> Block {
        let per_count = 1.0 / self.count.max(1) as f32;
        let block = Block {
            time: self.last,
            mean: self.sums.with(&Terms::NONE, |sum, _| sum * per_count),
            count: self.count,
            after_gap: self.after_gap,
        };
        self.count = 0;
        block
    }
}
