//! Random sensor errors that repeat with their seed.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

/// Standard deviations of the random error of one reading.
#[derive(Debug, Clone, Copy)]
pub struct Sigmas {
    /// Speed, relative.
    pub speed: f64,
    /// Pressure, MPa.
    pub pressure_mpa: f64,
    /// Temperature, K.
    pub temperature_k: f64,
}

/// Bench points are means over some seconds of averaging.
pub const BENCH: Sigmas = Sigmas { speed: 2e-4, pressure_mpa: 0.02, temperature_k: 0.2 };
/// Single samples on a vehicle.
pub const DRIVE: Sigmas = Sigmas { speed: 5e-4, pressure_mpa: 0.05, temperature_k: 0.2 };

/// A source of normally distributed errors.
pub struct Noise(ChaCha8Rng);

impl Noise {
    /// A source that repeats with its seed.
    pub fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    /// A value of mean 0 and the given standard deviation.
    pub fn normal(&mut self, sigma: f64) -> f64 {
        let unit: f64 = StandardNormal.sample(&mut self.0);
        sigma * unit
    }
}
