//! Instruments with errors: a systematic one each, drawn once, and random ones that repeat with their seed.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal, Uniform};

use kou_identify::calibration::SensorClass;

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

/// The instruments of one rig.
#[derive(Debug)]
pub struct Instruments {
    random: ChaCha8Rng,
    sigmas: Sigmas,
    /// Systematic errors: pump speed, motor speed and pressure relative, temperature in K.
    systematic: [f64; 4],
}

impl Instruments {
    /// Instruments of a class, or without systematic errors; they repeat with their seed.
    #[must_use]
    pub fn new(seed: u64, class: Option<SensorClass>, sigmas: Sigmas) -> Self {
        // A generator of their own, so that bench and drive of one seed have the same instruments.
        let mut draw = ChaCha8Rng::seed_from_u64(seed ^ 0x5eed);
        let mut within = |permissible: f64| match Uniform::new_inclusive(-permissible, permissible) {
            Ok(uniform) => uniform.sample(&mut draw),
            Err(_) => 0.0,
        };
        let systematic = class.map_or([0.0; 4], |class| {
            let [speed, _, pressure, temperature_k] = class.permissible();
            [within(speed), within(speed), within(pressure), within(temperature_k)]
        });
        Self { random: ChaCha8Rng::seed_from_u64(seed), sigmas, systematic }
    }

    /// A value of mean 0 and the given standard deviation.
    pub fn normal(&mut self, sigma: f64) -> f64 {
        let unit: f64 = StandardNormal.sample(&mut self.random);
        sigma * unit
    }

    /// Reading of the pump's speed.
    pub fn pump_speed(&mut self, rpm: f64) -> f64 {
        rpm * (1.0 + self.systematic[0] + self.normal(self.sigmas.speed))
    }

    /// Reading of the motor's speed.
    pub fn motor_speed(&mut self, rpm: f64) -> f64 {
        rpm * (1.0 + self.systematic[1] + self.normal(self.sigmas.speed))
    }

    /// Reading of a pressure.
    pub fn pressure(&mut self, mpa: f64) -> f64 {
        mpa * (1.0 + self.systematic[2]) + self.normal(self.sigmas.pressure_mpa)
    }

    /// Reading of a temperature.
    pub fn temperature(&mut self, c: f64) -> f64 {
        c + self.systematic[3] + self.normal(self.sigmas.temperature_k)
    }

    /// What a heading says about the errors.
    #[must_use]
    pub fn describe(&self) -> String {
        let [pump, motor, pressure, temperature_k] = self.systematic;
        format!(
            "Systematic errors: pump speed {:+.3} %, motor speed {:+.3} %, pressure {:+.3} %, temperature {temperature_k:+.2} K. \
             Random, 1 sigma: each speed {} %, pressure {} MPa, temperature {} K.",
            100.0 * pump,
            100.0 * motor,
            100.0 * pressure,
            100.0 * self.sigmas.speed,
            self.sigmas.pressure_mpa,
            self.sigmas.temperature_k
        )
    }
}
