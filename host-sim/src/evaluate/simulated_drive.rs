//! Simulated drive: one machine with one set of sensors, and an event that changes either.

use std::sync::Arc;

use kou_estimator::model::flow_balance::{OperatingPoint, ReducedModel};
use kou_estimator::units::{Celsius, LeakageCoefficient, Megapascal, Micros, Ratio, RevPerMin};
use kou_estimator::{Params, Reading, Sample};

use super::duty_cycle::{DutyCycle, DutyPoint, PERIOD_S};
use crate::noise::Noise;
use kou_identify::SensorClass;

/// Constant error of one sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SensorOffset {
    /// Offset of the pressure, MPa.
    Pressure(f64),
    /// Offset of the oil temperature, K.
    Temperature(f64),
    /// Offset of the pump's speed, r/min.
    PumpSpeed(f64),
    /// Offset of the motor's speed, r/min.
    MotorSpeed(f64),
    /// Offset of the displacement.
    Displacement(f64),
}

/// Event that begins at a scheduled time.
#[derive(Debug, Clone, PartialEq)]
pub enum DriveEvent {
    /// Leakage grows by a fraction of the law's within a time, then stays.
    Leak {
        /// Fraction of the law's leakage.
        share: f64,
        /// Time in which it grows, s.
        within_s: f64,
    },
    /// Leakage grows steadily.
    Drift {
        /// Fraction of the law's leakage per hour.
        per_h: f64,
    },
    /// A sensor gets a constant error.
    Sensor(SensorOffset),
    /// The oil changes, for instance by entrained air: the machine's model with that oil.
    Oil(Arc<ReducedModel>),
}

/// Machine, sensors and duty cycle.
#[derive(Debug, Clone)]
pub struct SimulatedDrive {
    params: Params,
    drive: DutyCycle,
    noise: Noise,
    misfit: f64,
    waves: [[f64; 4]; 3],
    speed_gains: [f64; 2],
    pressure_gain: f64,
    temperature_offset_k: f64,
    level_at_start: f64,
    ageing_per_h: f64,
    event: Option<(f64, DriveEvent)>,
    time_s: f64,
    level: f64,
}

/// Random errors of one sample, 1 sigma.
const SPEED_NOISE: f64 = 5e-4;
const PRESSURE_NOISE_MPA: f64 = 0.05;
const TEMPERATURE_NOISE_K: f64 = 0.1;

impl SimulatedDrive {
    /// A machine whose leakage deviates from the law of `params` by `misfit` (relative, 1 sigma over operating points), with
    /// sensors of a class: their systematic errors are drawn from the seed.
    #[must_use]
    pub fn new(params: &Params, limits: [f64; 3], class: SensorClass, misfit: f64, seed: u64) -> Self {
        let mut noise = Noise::new(seed);
        let [speed, _, pressure, temperature_k] = class.permissible();
        // Smooth over the envelope: waves of about one period across it, in random directions.
        let waves = std::array::from_fn(|_| {
            [noise.normal(0.6), noise.normal(0.6), noise.normal(0.6), noise.normal(2.0)]
        });
        Self {
            params: params.clone(),
            drive: DutyCycle::new(seed ^ 0x5eed, limits),
            misfit,
            waves,
            speed_gains: [noise.within(speed), noise.within(speed)],
            pressure_gain: noise.within(pressure),
            temperature_offset_k: noise.within(temperature_k),
            level_at_start: 1.0,
            ageing_per_h: 0.0,
            event: None,
            time_s: 0.0,
            level: 1.0,
            noise,
        }
    }

    /// Schedules an event.
    pub fn schedule(&mut self, at_s: f64, event: DriveEvent) {
        self.event = Some((at_s, event));
    }

    /// Sets the wear since the calibration: true leakage over the law's at the start.
    pub fn start_at_level(&mut self, level: f64) {
        self.level_at_start = level;
    }

    /// Sets the ageing of the oil: relative rise of leakage per hour as its viscosity falls.
    pub fn age_oil(&mut self, per_h: f64) {
        self.ageing_per_h = per_h;
    }

    /// Time of the last sample.
    #[must_use]
    pub fn time_s(&self) -> f64 {
        self.time_s
    }

    /// True leakage over that of the healthy machine.
    #[must_use]
    pub fn level(&self) -> f64 {
        self.level
    }

    /// Measured operating point of a sample in the law's normalised variables.
    #[must_use]
    pub fn normalised(&self, sample: &Sample) -> Option<[f64; 3]> {
        let (n_p, p_h) = (sample.pump_speed.value.ok()?, sample.high_pressure.value.ok()?);
        Some(self.params.law().normalised(n_p, p_h, sample.oil_temperature.value.ok()?).map(f64::from))
    }

    /// Advances by one period. Returns the sample and the true leakage coefficient.
    pub fn advance(&mut self) -> (Sample, f64) {
        self.time_s += PERIOD_S;
        let point = self.drive.advance();
        self.level = self.level_at_start + self.ageing_per_h * self.time_s / 3600.0;
        let (mut fault, mut oil) = (None, None);
        if let Some((at_s, event)) = &self.event
            && self.time_s >= *at_s
        {
            let since_s = self.time_s - at_s;
            match event {
                DriveEvent::Leak { share, within_s } => self.level += share * (since_s / within_s).min(1.0),
                DriveEvent::Drift { per_h } => self.level += per_h * since_s / 3600.0,
                DriveEvent::Sensor(what) => fault = Some(*what),
                DriveEvent::Oil(model) => oil = Some(Arc::clone(model)),
            }
        }
        self.sample(&point, fault, oil.as_deref())
    }

    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "the estimator works in f32 and microseconds"
    )]
    fn sample(
        &mut self,
        point: &DutyPoint,
        fault: Option<SensorOffset>,
        oil: Option<&ReducedModel>,
    ) -> (Sample, f64) {
        let low_mpa = self.params.low_pressure().get();
        let at = OperatingPoint {
            pump_speed: RevPerMin(point.n_p_rpm as f32),
            high_pressure: Megapascal(point.p_h_mpa as f32),
            low_pressure: Megapascal(low_mpa),
            oil_temperature: Celsius(point.t_b_c as f32),
            displacement: Ratio(point.alpha as f32),
        };
        let law = self.params.law();
        let [x, y, z] = law.normalised(at.pump_speed, at.high_pressure, at.oil_temperature);
        let by_law = f64::from(law.evaluate([x, y, z]).get());
        let kou = self.level * by_law * (1.0 + self.misfit_at([x, y, z].map(f64::from)));
        let model = oil.unwrap_or(self.params.reduced());
        let ratio = if point.alpha == 0.0 || point.p_h_mpa <= f64::from(low_mpa) + 0.5 {
            0.0
        } else {
            f64::from(model.balance(&at).ratio(LeakageCoefficient(kou as f32)).get())
        };
        let [pump_gain, motor_gain] = self.speed_gains;
        let noise = &mut self.noise;
        let mut n_p = point.n_p_rpm * (1.0 + pump_gain + noise.normal(SPEED_NOISE));
        let mut n_m = point.n_p_rpm * ratio * (1.0 + motor_gain + noise.normal(SPEED_NOISE));
        let mut p_h = point.p_h_mpa * (1.0 + self.pressure_gain) + noise.normal(PRESSURE_NOISE_MPA);
        let mut t_b = point.t_b_c + self.temperature_offset_k + noise.normal(TEMPERATURE_NOISE_K);
        let mut alpha = point.alpha;
        match fault {
            Some(SensorOffset::Pressure(offset)) => p_h += offset,
            Some(SensorOffset::Temperature(offset)) => t_b += offset,
            Some(SensorOffset::PumpSpeed(offset)) => n_p += offset,
            Some(SensorOffset::MotorSpeed(offset)) => n_m += offset * ratio.signum(),
            Some(SensorOffset::Displacement(offset)) => alpha += offset * alpha.signum(),
            None => {}
        }
        let time = Micros((self.time_s * 1e6).round() as u64);
        let mut sample = Sample::empty(time);
        sample.pump_speed = Reading::new(time, RevPerMin(n_p as f32));
        sample.motor_speed = Reading::new(time, RevPerMin(n_m as f32));
        sample.high_pressure = Reading::new(time, Megapascal(p_h as f32));
        sample.oil_temperature = Reading::new(time, Celsius(t_b as f32));
        sample.displacement = Reading::new(time, Ratio(alpha.clamp(-1.0, 1.0) as f32));
        (sample, kou)
    }

    /// Relative misfit at a normalised operating point: three waves, each of a third of the variance.
    fn misfit_at(&self, [x, y, z]: [f64; 3]) -> f64 {
        let amplitude = self.misfit * (2.0_f64 / 3.0).sqrt();
        self.waves
            .iter()
            .map(|[a, b, c, phase]| {
                amplitude * (std::f64::consts::TAU * (a * x + b * y + c * z) + phase).cos()
            })
            .sum()
    }
}
