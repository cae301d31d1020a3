//! Seeded random errors: the same seed gives the same numbers.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal, Uniform};

/// Seeded source of random errors.
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

    /// A number uniformly distributed between `-limit` and `limit`: a systematic error of which only the permissible size is
    /// known.
    pub fn within(&mut self, limit: f64) -> f64 {
        Uniform::new_inclusive(-limit, limit).map_or(0.0, |uniform| uniform.sample(&mut self.0))
    }
}
