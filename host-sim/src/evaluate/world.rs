//! One machine with one set of sensors, and what happens to them.

use std::sync::Arc;

use kou_estimator::model::flow_balance::{OperatingPoint, ReducedModel};
use kou_estimator::units::{Celsius, LeakageCoefficient, Megapascal, Micros, Ratio, RevPerMin};
use kou_estimator::{Params, Reading, Sample};

use super::drive::{Drive, PERIOD_S, Point};
use super::noise::Noise;
use kou_identify::calibration::SensorClass;

/// What goes wrong with a sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Fault {
    /// Offset of the pressure, MPa.
    PressureOffset(f64),
    /// Offset of the oil temperature, K.
    TemperatureOffset(f64),
    /// Offset of the pump's speed, r/min.
    PumpSpeedOffset(f64),
    /// Offset of the motor's speed, r/min.
    MotorSpeedOffset(f64),
    /// Offset of the displacement.
    DisplacementOffset(f64),
}

/// Something that begins at a time.
#[derive(Debug, Clone, PartialEq)]
pub enum Event {
    /// Leakage grows by this share of the law within a time, then stays.
    Leak {
        /// Share of the law.
        share: f64,
        /// Time in which it grows, s.
        within_s: f64,
    },
    /// Leakage grows by this share per hour.
    Drift {
        /// Share of the law per hour.
        per_h: f64,
    },
    /// A sensor gets an error.
    Sensor(Fault),
    /// The oil becomes another, for one by air that it carries: the machine with that oil.
    Oil(Arc<ReducedModel>),
}

/// Machine, sensors and their history.
#[derive(Debug, Clone)]
pub struct World {
    params: Params,
    drive: Drive,
    noise: Noise,
    misfit: f64,
    waves: [[f64; 4]; 3],
    speed_gains: [f64; 2],
    pressure_gain: f64,
    temperature_offset_k: f64,
    level_at_start: f64,
    ageing_per_h: f64,
    event: Option<(f64, Event)>,
    time_s: f64,
    level: f64,
}

/// Random errors of one sample, 1 sigma.
const SPEED_NOISE: f64 = 5e-4;
const PRESSURE_NOISE_MPA: f64 = 0.05;
const TEMPERATURE_NOISE_K: f64 = 0.1;

impl World {
    /// A machine whose leakage misses the law of `params` by `misfit` (relative, 1 sigma over operating points), with
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
            drive: Drive::new(seed ^ 0x5eed, limits),
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

    /// Lets something happen from a time on.
    pub fn schedule(&mut self, at_s: f64, event: Event) {
        self.event = Some((at_s, event));
    }

    /// Makes it a machine that has worn since it was calibrated: true leakage over the law's at the start.
    pub fn begin_at(&mut self, level: f64) {
        self.level_at_start = level;
    }

    /// Lets the oil's viscosity fall with use: leakage rises by this share per hour.
    pub fn age_oil(&mut self, per_h: f64) {
        self.ageing_per_h = per_h;
    }

    /// Time of the last sample.
    #[must_use]
    pub fn time_s(&self) -> f64 {
        self.time_s
    }

    /// True leakage over the healthy machine's.
    #[must_use]
    pub fn level(&self) -> f64 {
        self.level
    }

    /// Where a sample lies in the law's normalised variables, as its sensors see it.
    #[must_use]
    pub fn normalised(&self, sample: &Sample) -> Option<[f64; 3]> {
        let (n_p, p_h) = (sample.pump_speed.value.ok()?, sample.high_pressure.value.ok()?);
        Some(self.params.law().normalised(n_p, p_h, sample.oil_temperature.value.ok()?).map(f64::from))
    }

    /// The next sample, with the true operating point's leakage coefficient.
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
                Event::Leak { share, within_s } => self.level += share * (since_s / within_s).min(1.0),
                Event::Drift { per_h } => self.level += per_h * since_s / 3600.0,
                Event::Sensor(what) => fault = Some(*what),
                Event::Oil(model) => oil = Some(Arc::clone(model)),
            }
        }
        self.sample(&point, fault, oil.as_deref())
    }

    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "the estimator works in f32 and microseconds"
    )]
    fn sample(&mut self, point: &Point, fault: Option<Fault>, oil: Option<&ReducedModel>) -> (Sample, f64) {
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
            Some(Fault::PressureOffset(offset)) => p_h += offset,
            Some(Fault::TemperatureOffset(offset)) => t_b += offset,
            Some(Fault::PumpSpeedOffset(offset)) => n_p += offset,
            Some(Fault::MotorSpeedOffset(offset)) => n_m += offset * ratio.signum(),
            Some(Fault::DisplacementOffset(offset)) => alpha += offset * alpha.signum(),
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
