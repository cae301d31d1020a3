//! Simulated instruments: each with a systematic error drawn once, and random errors that repeat with their seed.

use kou_identify::SensorClass;

use crate::noise::Noise;

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

/// Bench: means over some seconds.
pub const BENCH: Sigmas = Sigmas { speed: 2e-4, pressure_mpa: 0.02, temperature_k: 0.2 };
/// Vehicle: single samples.
pub const DRIVE: Sigmas = Sigmas { speed: 5e-4, pressure_mpa: 0.05, temperature_k: 0.2 };

/// Instruments of one test rig or vehicle.
#[derive(Debug)]
pub struct Instruments {
    random: Noise,
    sigmas: Sigmas,
    /// Systematic errors: pump speed, motor speed and pressure relative, temperature in K.
    systematic: [f64; 4],
}

impl Instruments {
    /// Instruments of a class, or without systematic errors; they repeat with their seed.
    #[must_use]
    pub fn new(seed: u64, class: Option<SensorClass>, sigmas: Sigmas) -> Self {
        // A generator of their own, so that bench and drive of one seed have the same instruments.
        let mut draw = Noise::new(seed ^ 0x5eed);
        let systematic = class.map_or([0.0; 4], |class| {
            let [speed, _, pressure, temperature_k] = class.permissible();
            [speed, speed, pressure, temperature_k].map(|permissible| draw.within(permissible))
        });
        Self { random: Noise::new(seed), sigmas, systematic }
    }

    /// A value of mean 0 and the given standard deviation.
    pub fn normal(&mut self, sigma: f64) -> f64 {
        self.random.normal(sigma)
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

    /// Description of the errors for the heading of a file.
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
