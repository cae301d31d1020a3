//! Samples that reach every branch of the estimator: good ones all over the envelope, and every kind of bad one.
//!
//! The stream is pseudo-random and depends on its seed only: a failure can be repeated by its number.

use kou_estimator::health::HealthState;
use kou_estimator::units::{Celsius, LitrePerMin, Megapascal, Micros, Ratio, RevPerMin};
use kou_estimator::{Fault, Reading, Sample, State, step};

pub use kou_fixture::SplitMix64;

use crate::reference_params;

/// Values that no sensor should give.
const STRANGE: [f32; 14] = [
    f32::NAN,
    f32::INFINITY,
    f32::NEG_INFINITY,
    0.0,
    -0.0,
    f32::MIN_POSITIVE,
    1e-42,
    -1e-42,
    f32::MAX,
    f32::MIN,
    1e6,
    -1e6,
    f32::EPSILON,
    -1.0,
];

/// An endless stream of samples, 10 ms apart.
#[derive(Debug, Clone)]
pub struct HostileSamples {
    random: SplitMix64,
    time_us: u64,
}

impl HostileSamples {
    /// The stream of a seed.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self { random: SplitMix64(seed), time_us: 1_000_000 }
    }

    fn reading<U>(&mut self, good: U, make: impl Fn(f32) -> U) -> Reading<U> {
        let now = self.time_us;
        let random = &mut self.random;
        if !random.one_in(24) {
            return Reading::new(Micros(now.saturating_sub(random.next_u64() % 5_000)), good);
        }
        match random.below(6) {
            0 => Reading::failed(Micros(now), Fault::ALL[random.below(Fault::ALL.len())]),
            1 => Reading::new(Micros(now.saturating_sub(100_000 + random.next_u64() % 3)), good),
            2 => Reading::new(Micros(now + 1 + random.next_u64() % 1000), good),
            3 => Reading::new(Micros(now), make(STRANGE[random.below(STRANGE.len())])),
            // Any bits at all: every NaN, every denormal.
            4 => Reading::new(Micros(now), make(f32::from_bits(random.next_u64() as u32))),
            _ => Reading::new(Micros(random.next_u64()), good),
        }
    }
}

impl Iterator for HostileSamples {
    type Item = Sample;

    fn next(&mut self) -> Option<Sample> {
        self.time_us += 10_000;
        if self.random.one_in(500) {
            self.time_us = self.random.next_u64() >> self.random.below(64);
        }
        let random = &mut self.random;
        let n_p = random.between(250.0, 2900.0);
        let alpha = match random.below(4) {
            0 => random.between(-1.05, 1.05),
            1 => -1.0,
            _ => 1.0,
        };
        let p_h = random.between(4.0, 52.0);
        let p_l = random.between(0.8, 2.5);
        let t_b = random.between(20.0, 95.0);
        // Leak-free loss of some 0.1 % per MPa; sometimes more or less than any leakage explains.
        let loss = 0.001 * p_h + random.between(-0.01, 0.25) * p_h / n_p * 8.0;
        let n_m = n_p * alpha * (1.0 - loss);
        let fitted = random.next_u64();
        let flow = random.between(0.0, 900.0);
        let mut sample = Sample::empty(Micros(self.time_us));
        sample.pump_speed = self.reading(RevPerMin(n_p), RevPerMin);
        sample.motor_speed = self.reading(RevPerMin(n_m), RevPerMin);
        sample.high_pressure = self.reading(Megapascal(p_h), Megapascal);
        sample.oil_temperature = self.reading(Celsius(t_b), Celsius);
        if fitted & 1 != 0 {
            sample.low_pressure = self.reading(Megapascal(p_l), Megapascal);
        }
        if fitted & 2 != 0 || alpha != 1.0 {
            sample.displacement = self.reading(Ratio(alpha), Ratio);
        }
        if fitted & 12 == 12 {
            sample.flow = self.reading(LitrePerMin(flow), LitrePerMin);
        }
        Some(sample)
    }
}

/// Health state learned with the reference calibration over plateaus of driving that depend on the version.
#[must_use]
pub fn learned(version: u32) -> HealthState {
    let params = reference_params();
    let mut state = State::new();
    for i in 0..4_000_u32 {
        let time = Micros(u64::from(version) * 1_000_000_000 + u64::from(i) * 10_000);
        let plateau = f32::from(u16::try_from(i / 1000 + version % 7).unwrap_or(0));
        let mut sample = Sample::empty(time);
        let n_p = 1200.0 + 100.0 * plateau;
        sample.pump_speed = Reading::new(time, RevPerMin(n_p));
        sample.motor_speed = Reading::new(time, RevPerMin(n_p * (0.93 - 0.002 * plateau)));
        sample.high_pressure = Reading::new(time, Megapascal(20.0 + plateau));
        sample.oil_temperature = Reading::new(time, Celsius(50.0 + plateau));
        let health = step(&params, &mut state, &sample).health;
        assert!(health.level.get() > 0.0, "a level is a positive ratio");
    }
    state.health().clone()
}
