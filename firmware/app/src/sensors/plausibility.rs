//! Plausibility checks between sensors (analytical redundancy): errors that no single sensor can detect.
//!
//! | rule | condition | sensor in question |
//! |---|---|---|
//! | the low line is at charge pressure | the pump turns | low line's sensor |
//! | both lines are at charge pressure | the pump turns, displacement about zero | each sensor outside charge pressure |
//! | both lines read the same | the pump turns, the motor is at rest, displacement about zero | both sensors, or the one outside charge pressure |
//! | the displacement is zero | the pump turns, the motor is at rest, both lines read the same charge pressure | displacement |
//! | the motor turns | the pump turns, displacement large, high line below its relief setting | motor pickup |
//! | the pump turns | the motor turns | pump pickup |
//! | the motor is not faster than pump and displacement allow | the pump turns | motor pickup |
//!
//! Each rule has its own debounce and, once violated for that time, makes the reading `Implausible` until the rule is
//! satisfied again. The drive is redundant in neutral: with the pump turning and the motor at rest, oil that does not
//! pass the motor can only leak, so equal pressures imply zero displacement (0.002 feeds the leakage at charge
//! pressure), and zero displacement implies equal pressures. A single failure at a time is assumed: with two, neither
//! rule applies.
//!
//! Limits: an offset of the high line's sensor is detected only while its line is low or in neutral; one of the
//! displacement only in neutral; one of the thermometer only by comparison with another thermometer
//! ([`PlausibilityState::compare_oil`]).

use kou_estimator::units::{Celsius, Megapascal, Ratio, RevPerMin};
use kou_estimator::{Fault, Reading};

use super::config::{ConfigError, consistent, number};
use super::debounce::{DebounceConfig, DebounceParams, DebounceState};

/// Limits of the plausibility checks of one drive.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct PlausibilityConfig {
    /// Pump speed from which the charge circuit maintains its pressure and signals must vary, 50 to 2000 r/min.
    pub working_speed: RevPerMin,
    /// Lowest charge pressure, -0.1 to 10 MPa.
    pub charge_lowest: Megapascal,
    /// Highest charge pressure, up to 10 MPa.
    pub charge_highest: Megapascal,
    /// Largest difference between the lines' sensors in neutral: sum of their permissible errors, below the pressure
    /// that turns the motor; 0.02 to 5 MPa.
    pub neutral_difference: Megapascal,
    /// Largest displacement reading in neutral, 0.002 to 0.2.
    pub zero_displacement: Ratio,
    /// Largest difference between two oil thermometers, 1 to 50 K.
    pub oil_difference: Celsius,
    /// Displacement below which the drive is idle, 0 to 0.2.
    pub idle_displacement: Ratio,
    /// Displacement from which the motor must turn, 0.1 to 1.
    pub driving_displacement: Ratio,
    /// High-line pressure from which a load may stall the motor: some MPa below the relief valve's setting, 1 to 100
    /// MPa.
    pub stall_pressure: Megapascal,
    /// Largest speed ratio at full displacement including a margin, 0.1 to 10.
    pub largest_ratio: Ratio,
    /// Confirmation and healing, in calls.
    pub debounce: DebounceConfig,
}

/// Checked limits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlausibilityParams {
    config: PlausibilityConfig,
    debounce: DebounceParams,
}

impl PlausibilityParams {
    /// Checks the limits.
    ///
    /// # Errors
    /// The first field out of range or inconsistent.
    pub fn new(config: &PlausibilityConfig) -> Result<Self, ConfigError> {
        number("working_speed", config.working_speed.get(), 50.0, 2000.0)?;
        number("charge_lowest", config.charge_lowest.get(), -0.1, 10.0)?;
        number("charge_highest", config.charge_highest.get(), -0.1, 10.0)?;
        consistent(
            "charge_highest",
            config.charge_highest > config.charge_lowest,
            "it must lie above charge_lowest",
        )?;
        number("neutral_difference", config.neutral_difference.get(), 0.02, 5.0)?;
        number("zero_displacement", config.zero_displacement.get(), 0.002, 0.2)?;
        number("oil_difference", config.oil_difference.get(), 1.0, 50.0)?;
        number("idle_displacement", config.idle_displacement.get(), 0.0, 0.2)?;
        number("driving_displacement", config.driving_displacement.get(), 0.1, 1.0)?;
        number("stall_pressure", config.stall_pressure.get(), 1.0, 100.0)?;
        number("largest_ratio", config.largest_ratio.get(), 0.1, 10.0)?;
        Ok(Self { config: *config, debounce: DebounceParams::new(&config.debounce)? })
    }

    /// Highest charge pressure.
    #[must_use]
    pub const fn charge_highest(&self) -> Megapascal {
        self.config.charge_highest
    }

    /// Whether the machine is working at this pump speed.
    #[must_use]
    pub fn works_at(&self, pump: &Reading<RevPerMin>) -> bool {
        pump.value.is_ok_and(|n| n >= self.config.working_speed)
    }
}

/// State of the plausibility checks: debounce of every rule.
#[doc(alias = "analytical redundancy")]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct PlausibilityState {
    line_a: DebounceState,
    line_b: DebounceState,
    same_a: DebounceState,
    same_b: DebounceState,
    pump: DebounceState,
    motor: DebounceState,
    displacement: DebounceState,
    oil: DebounceState,
}

/// Readings compared by the rules; an implausible one is marked in place.
#[derive(Debug)]
pub struct Readings<'a> {
    /// Pump speed, without sign.
    pub pump: &'a mut Reading<RevPerMin>,
    /// Motor speed, without sign.
    pub motor: &'a mut Reading<RevPerMin>,
    /// Pressure of line A.
    pub line_a: &'a mut Reading<Megapascal>,
    /// Pressure of line B, where it is measured.
    pub line_b: Option<&'a mut Reading<Megapascal>>,
    /// Displacement; not fitted means full.
    pub displacement: &'a mut Reading<Ratio>,
}

impl PlausibilityState {
    /// No rule violated.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            line_a: DebounceState::new(),
            line_b: DebounceState::new(),
            same_a: DebounceState::new(),
            same_b: DebounceState::new(),
            pump: DebounceState::new(),
            motor: DebounceState::new(),
            displacement: DebounceState::new(),
            oil: DebounceState::new(),
        }
    }

    /// Compares a set of readings, and marks implausible ones.
    pub fn update(&mut self, params: &PlausibilityParams, readings: Readings<'_>) {
        let Readings { pump, motor, line_a, line_b, displacement } = readings;
        let alpha = match displacement.value {
            Ok(alpha) => Some(alpha.get().abs()),
            Err(Fault::NotFitted) => Some(1.0),
            Err(_) => None,
        };
        let works = params.works_at(pump);
        let (a, b) = (line_a.value.ok(), line_b.as_ref().and_then(|line| line.value.ok()));

        let rests = works && motor.value.is_ok_and(|n| n.get() == 0.0);
        let neutral = if rests { params.neutral(a, b, alpha) } else { Neutral::default() };
        let (pump_fits, motor_fits) = params.speeds(pump, motor, a, b, alpha, neutral.displacement.is_some());
        let idle = alpha.is_some_and(|alpha| alpha <= params.config.idle_displacement.get());
        let (a_fits, b_fits) = if works { params.lines(a, b, idle) } else { (None, None) };

        // A pump that reads zero while the motor turns is not at rest: its rule applies at any speed.
        settle(&mut self.pump, params, pump_fits, pump);
        settle(&mut self.motor, params, motor_fits, motor);
        settle(&mut self.line_a, params, a_fits, line_a);
        settle(&mut self.same_a, params, neutral.line_a, line_a);
        if let Some(line_b) = line_b {
            settle(&mut self.line_b, params, b_fits, line_b);
            settle(&mut self.same_b, params, neutral.line_b, line_b);
        }
        settle(&mut self.displacement, params, neutral.displacement, displacement);
    }

    /// Compares the oil temperature with an external reading, if there is one. Which of the two is wrong is unknown,
    /// so the controller's own reading becomes implausible.
    pub fn compare_oil(
        &mut self,
        params: &PlausibilityParams,
        oil: &mut Reading<Celsius>,
        other: &Reading<Celsius>,
    ) {
        let fits = match (oil.value, other.value) {
            (Ok(own), Ok(other)) => {
                Some((own.get() - other.get()).abs() <= params.config.oil_difference.get())
            }
            _ => None,
        };
        settle(&mut self.oil, params, fits, oil);
    }
}

/// Result of the neutral rules for each sensor; `None` where no rule applies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Neutral {
    line_a: Option<bool>,
    line_b: Option<bool>,
    displacement: Option<bool>,
}

impl PlausibilityParams {
    fn at_charge(&self, p: Megapascal) -> bool {
        p >= self.config.charge_lowest && p <= self.config.charge_highest
    }

    /// Whether each line's pressure is plausible; `None` where no rule applies.
    fn lines(
        &self,
        a: Option<Megapascal>,
        b: Option<Megapascal>,
        idle: bool,
    ) -> (Option<bool>, Option<bool>) {
        match (a, b) {
            (Some(a), b) if idle => (Some(self.at_charge(a)), b.map(|b| self.at_charge(b))),
            (Some(a), Some(b)) if a < b => (Some(self.at_charge(a)), None),
            (Some(_), Some(b)) => (None, Some(self.at_charge(b))),
            _ => (None, None),
        }
    }

    /// Neutral rules: pump turning and motor at rest.
    fn neutral(&self, a: Option<Megapascal>, b: Option<Megapascal>, alpha: Option<f32>) -> Neutral {
        let (Some(a), Some(b), Some(alpha)) = (a, b, alpha) else { return Neutral::default() };
        let same = (a.get() - b.get()).abs() <= self.config.neutral_difference.get();
        let idle = alpha <= self.config.idle_displacement.get();
        let (a_at, b_at) = (self.at_charge(a), self.at_charge(b));
        Neutral {
            // Of two that differ the one outside charge pressure is wrong; if both are inside, both are in question.
            line_a: idle.then_some(same || (a_at && !b_at)),
            line_b: idle.then_some(same || (b_at && !a_at)),
            displacement: (same && a_at && b_at).then_some(alpha <= self.config.zero_displacement.get()),
        }
    }

    /// Whether pump and motor speed are plausible; `None` where no rule applies.
    fn speeds(
        &self,
        pump: &Reading<RevPerMin>,
        motor: &Reading<RevPerMin>,
        a: Option<Megapascal>,
        b: Option<Megapascal>,
        alpha: Option<f32>,
        is_neutral: bool,
    ) -> (Option<bool>, Option<bool>) {
        let config = &self.config;
        let (Ok(n_p), Ok(n_m)) = (pump.value, motor.value) else { return (None, None) };
        if n_p < config.working_speed {
            // A motor driven by its load turns the pump as well, unless the displacement is about zero.
            let linked = alpha.is_some_and(|alpha| alpha >= config.driving_displacement.get());
            let contradicts = n_p.get() == 0.0 && n_m >= config.working_speed;
            return if linked { (Some(!contradicts), None) } else { (None, None) };
        }
        let Some(alpha) = alpha else { return (Some(true), None) };
        // The motor coasts briefly after the displacement returns to zero; the debounce is longer.
        let fastest = config.largest_ratio.get() * n_p.get() * alpha.max(config.idle_displacement.get());
        if n_m.get() > fastest {
            return (Some(true), Some(false));
        }
        let high = match (a, b) {
            (Some(a), Some(b)) => Some(if a > b { a } else { b }),
            (one, other) => one.or(other),
        };
        let may_stand = is_neutral
            || alpha < config.driving_displacement.get()
            || high.is_none_or(|high| high >= config.stall_pressure);
        (Some(true), if may_stand && n_m.get() == 0.0 { None } else { Some(n_m.get() > 0.0) })
    }
}

/// Updates a rule's debounce, and marks the reading `Implausible` while its fault is confirmed.
fn settle<U>(
    state: &mut DebounceState,
    params: &PlausibilityParams,
    fits: Option<bool>,
    reading: &mut Reading<U>,
) {
    if let Some(fits) = fits {
        state.update(&params.debounce, if fits { Ok(()) } else { Err(Fault::Implausible) });
    }
    if let (Some(fault), Ok(_)) = (state.fault(), &reading.value) {
        *reading = Reading::failed(reading.time, fault);
    }
}
