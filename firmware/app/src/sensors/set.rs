//! Sensor set of a drive: inputs of each millisecond in, a sample for the estimator out.

use kou_estimator::units::{Celsius, Megapascal, Micros, Ratio, RevPerMin};
use kou_estimator::{Reading, Sample};

use super::adc::{AdcCounts, ConversionError, Input};
use super::analog::{AnalogConfig, AnalogParams, AnalogState};
use super::config::ConfigError;
use super::pickup::{Edges, PickupConfig, PickupCounts, PickupParams, PickupState};
use super::plausibility::{PlausibilityConfig, PlausibilityParams, PlausibilityState, Readings};
use super::scale::{LinearConfig, Scale, ThermometerConfig};

/// Analogue channels of a drive.
pub const CHANNELS: usize = 4;

/// Configuration of a drive's sensors.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SensorsConfig {
    /// Line A, high in forward drive; or the only pressure sensor, on the high line.
    pub line_a: (Input, LinearConfig<Megapascal>, AnalogConfig<Megapascal>),
    /// Line B, if it has a sensor; then either line may be the high one.
    pub line_b: Option<(Input, LinearConfig<Megapascal>, AnalogConfig<Megapascal>)>,
    /// Oil in the case or tank.
    pub oil: (Input, ThermometerConfig, AnalogConfig<Celsius>),
    /// Displacement of the pump; without a sensor the estimator assumes full displacement.
    pub displacement: Option<(Input, LinearConfig<Ratio>, AnalogConfig<Ratio>)>,
    /// Pickup on the pump's shaft.
    pub pump: PickupConfig,
    /// Pickup on the motor's shaft.
    pub motor: PickupConfig,
    /// Limits of the plausibility checks.
    pub plausibility: PlausibilityConfig,
}

/// Checked sensor configuration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorsParams {
    inputs: [Option<Input>; CHANNELS],
    line_a: AnalogParams<Megapascal>,
    line_b: Option<AnalogParams<Megapascal>>,
    oil: AnalogParams<Celsius>,
    displacement: Option<AnalogParams<Ratio>>,
    pump: PickupParams,
    motor: PickupParams,
    plausibility: PlausibilityParams,
}

impl SensorsParams {
    /// Checks the configuration of every sensor.
    ///
    /// # Errors
    /// The first field out of range or inconsistent.
    pub fn new(config: &SensorsConfig) -> Result<Self, ConfigError> {
        let pressure = |(_, linear, analog): &(Input, LinearConfig<_>, AnalogConfig<_>)| {
            AnalogParams::new(Scale::pressure(linear)?, analog)
        };
        let (oil_input, thermometer, oil) = &config.oil;
        Ok(Self {
            inputs: [
                Some(config.line_a.0),
                config.line_b.map(|(input, ..)| input),
                Some(*oil_input),
                config.displacement.map(|(input, ..)| input),
            ],
            line_a: pressure(&config.line_a)?,
            line_b: config.line_b.as_ref().map(pressure).transpose()?,
            oil: AnalogParams::new(Scale::temperature(thermometer)?, oil)?,
            displacement: match &config.displacement {
                Some((_, linear, analog)) => Some(AnalogParams::new(Scale::displacement(linear)?, analog)?),
                None => None,
            },
            pump: PickupParams::new(&config.pump)?,
            motor: PickupParams::new(&config.motor)?,
            plausibility: PlausibilityParams::new(&config.plausibility)?,
        })
    }

    /// Inputs to convert each millisecond, in the order of [`SensorInputs::analog`].
    #[must_use]
    pub const fn inputs(&self) -> &[Option<Input>; CHANNELS] {
        &self.inputs
    }
}

/// Inputs read in one millisecond.
#[derive(Debug, Clone)]
pub struct SensorInputs {
    /// Conversions of [`SensorsParams::inputs`]; those of channels not fitted are ignored.
    pub analog: [Result<AdcCounts, ConversionError>; CHANNELS],
    /// Timer count when the edges were collected.
    pub count: u32,
    /// Edges of the pump's pickup.
    pub pump: Edges,
    /// Edges of the motor's pickup.
    pub motor: Edges,
}

impl SensorInputs {
    /// Nothing read.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            analog: [Err(ConversionError::NoAnswer); CHANNELS],
            count: 0,
            pump: Edges::new(),
            motor: Edges::new(),
        }
    }
}

impl Default for SensorInputs {
    fn default() -> Self {
        Self::new()
    }
}

/// State of every sensor.
#[derive(Debug, Clone)]
pub struct SensorsState {
    now: Micros,
    line_a: AnalogState,
    line_b: AnalogState,
    oil: AnalogState,
    displacement: AnalogState,
    pump: PickupState,
    motor: PickupState,
    plausibility: PlausibilityState,
}

impl SensorsState {
    /// State before the first millisecond.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            now: Micros(0),
            line_a: AnalogState::new(),
            line_b: AnalogState::new(),
            oil: AnalogState::new(),
            displacement: AnalogState::new(),
            pump: PickupState::new(),
            motor: PickupState::new(),
            plausibility: PlausibilityState::new(),
        }
    }

    /// Processes the inputs read at `now`.
    pub fn observe(&mut self, params: &SensorsParams, now: Micros, inputs: &SensorInputs) {
        self.now = now;
        self.pump.poll(&params.pump, now, inputs.count, &inputs.pump);
        self.motor.poll(&params.motor, now, inputs.count, &inputs.motor);
        let live = params.plausibility.works_at(&self.pump.reading(&params.pump));
        let [line_a, line_b, oil, displacement] = inputs.analog;
        self.line_a.observe(&params.line_a, now, line_a, live);
        if let Some(params) = &params.line_b {
            self.line_b.observe(params, now, line_b, live);
        }
        self.oil.observe(&params.oil, now, oil, live);
        if let Some(params) = &params.displacement {
            self.displacement.observe(params, now, displacement, live);
        }
    }

    /// Present readings after plausibility checks, as a sample for the estimator. Call it at a fixed rate: the
    /// debounce of the checks counts calls. `other_oil` is the reading of an external thermometer, or the reason why
    /// there is none.
    pub fn sample(&mut self, params: &SensorsParams, other_oil: &Reading<Celsius>) -> Sample {
        let mut sample = Sample::empty(self.now);
        let mut pump = self.pump.reading(&params.pump);
        let mut motor = self.motor.reading(&params.motor);
        let mut line_a = self.line_a.reading();
        let mut line_b = params.line_b.is_some().then(|| self.line_b.reading());
        let mut displacement: Reading<Ratio> = match params.displacement {
            Some(_) => self.displacement.reading(),
            None => Reading::not_fitted(),
        };
        // Before the plausibility checks: an implausible line must not change sides.
        let charge_highest = params.plausibility.charge_highest();
        let high = line_b.as_ref().map_or(High::A, |line_b| high(&line_a, line_b, charge_highest));
        let readings = Readings {
            pump: &mut pump,
            motor: &mut motor,
            line_a: &mut line_a,
            line_b: line_b.as_mut(),
            displacement: &mut displacement,
        };
        self.plausibility.update(&params.plausibility, readings);

        let reversed = displacement.value.is_ok_and(|alpha| alpha.get() < 0.0);
        sample.pump_speed = pump;
        sample.motor_speed = Reading {
            value: motor.value.map(|n| RevPerMin(if reversed { -n.get() } else { n.get() })),
            ..motor
        };
        let line_b = line_b.unwrap_or(Reading::not_fitted());
        (sample.high_pressure, sample.low_pressure) = match high {
            High::A => (line_a, line_b),
            High::B => (line_b, line_a),
        };
        sample.oil_temperature = self.oil.reading();
        self.plausibility.compare_oil(&params.plausibility, &mut sample.oil_temperature, other_oil);
        // The swash plate has mechanical stops at full displacement: a reading beyond them, within the sensor's
        // range, is sensor error.
        sample.displacement = Reading {
            value: displacement.value.map(|alpha| Ratio(alpha.get().clamp(-1.0, 1.0))),
            ..displacement
        };
        sample
    }

    /// Edge counts of the pickups, pump and motor.
    #[must_use]
    pub const fn pickup_counts(&self) -> (PickupCounts, PickupCounts) {
        (self.pump.counts(), self.motor.counts())
    }
}

impl Default for SensorsState {
    fn default() -> Self {
        Self::new()
    }
}

/// Identity of the high line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum High {
    A,
    B,
}

/// High line. With one failed sensor it is the other line if that is above charge pressure; otherwise unknown: then
/// the failed line is assumed, because without it there is no estimate.
fn high(a: &Reading<Megapascal>, b: &Reading<Megapascal>, charge_highest: Megapascal) -> High {
    let a_is_high = match (a.value, b.value) {
        (Ok(a), Ok(b)) => a >= b,
        (Ok(a), Err(_)) => a > charge_highest,
        (Err(_), Ok(b)) => b <= charge_highest,
        (Err(_), Err(_)) => true,
    };
    if a_is_high { High::A } else { High::B }
}
