//! Random numbers that repeat with their seed.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal, Uniform};

/// A source of normally distributed numbers.
#[derive(Debug, Clone)]
pub struct Noise(ChaCha8Rng);

impl Noise {
    /// A source that repeats with its seed.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    /// A number of mean 0 and the given standard deviation.
    pub fn normal(&mut self, sigma: f64) -> f64 {
        let unit: f64 = StandardNormal.sample(&mut self.0);
        sigma * unit
    }

    /// A number that is anywhere between `-limit` and `limit` with the same probability: what is known of a systematic
    /// error of which only the permissible size is stated.
    pub fn within(&mut self, limit: f64) -> f64 {
        Uniform::new_inclusive(-limit, limit).map_or(0.0, |uniform| uniform.sample(&mut self.0))
    }
}
