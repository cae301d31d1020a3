//! Scenario files: driver commands, failures, calibration updates, and the expected states of the firmware.

use std::path::Path;

use kou_app::storage::RecordKind;
use serde::Deserialize;

use kou_records::{AllowedRange, InputError, TomlFile};

/// Version of the format.
const SCHEMA: u32 = 1;

/// Model that simulates the vehicle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum VehicleModel {
    /// The lumped model: every piston chamber.
    Full,
    /// The calibration's own reduced model with a motor of first-order lag: for long scenarios, which test the firmware and
    /// not the estimator's accuracy.
    Surrogate,
}

/// Commands, load and wear at one time; linear in between.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DriverCommand {
    /// Time, s.
    pub time_s: f64,
    /// Pump speed, r/min.
    pub n_p_rpm: f64,
    /// Displacement fraction, -1 to 1.
    pub alpha: f64,
    /// Load that resists the motor, N m.
    pub load_nm: f64,
    /// Temperature of the compensated oil, degC.
    pub t_b_c: f64,
    /// Leakage over that of a new machine.
    #[serde(default = "one")]
    pub wear: f64,
}

const fn one() -> f64 {
    1.0
}

/// A sensor that may fail.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Sensor {
    /// Pressure of line A.
    LineA,
    /// Pressure of line B.
    LineB,
    /// Oil temperature.
    Oil,
    /// Displacement.
    Displacement,
    /// Pickup of the pump.
    Pump,
    /// Pickup of the motor.
    Motor,
}

/// Electrical failure of a sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FailureMode {
    /// Broken wire: no current, no edges, or infinite resistance.
    Open,
    /// Shorted wire.
    Short,
    /// The signal keeps its last value.
    Stuck,
    /// `size` is added, in the sensor's unit; of a pickup, the fraction of teeth lost.
    Offset,
    /// `size` per second is added; of a pickup, to the fraction of teeth lost.
    Drift,
    /// Normally distributed noise of standard deviation `size`; of a pickup, glitches per millisecond.
    Noise,
    /// The fraction `size` of conversions gets no answer, or of edges gets lost.
    DropOut,
}

/// Failure of one sensor.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorFailure {
    /// Failed sensor.
    pub sensor: Sensor,
    /// Failure mode.
    pub kind: FailureMode,
    /// Begin, s.
    pub from_s: f64,
    /// End, s.
    pub until_s: f64,
    /// Size, see [`FailureMode`].
    #[serde(default)]
    pub size: f64,
}

/// Flood of the CAN bus with random frames of other nodes.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BusFlood {
    /// Begin, s.
    pub from_s: f64,
    /// End, s.
    pub until_s: f64,
    /// Frames per millisecond, 8 at most; 250 kbit/s carry two.
    pub frames_per_ms: u32,
}

/// Failure of the supply in the middle of a write to flash.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PowerCut {
    /// Time after which the next write of the record is cut, s.
    pub from_s: f64,
    /// Record whose write is cut: `calibration`, `health`, `faults`, `life`, `update_counter`.
    pub during: String,
    /// Bytes written before the cut, both copies and moved records counted.
    pub byte: usize,
    /// Duration of the outage, s.
    #[serde(default = "third")]
    pub off_s: f64,
}

const fn third() -> f64 {
    0.3
}

/// Calibration update over the bus.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScheduledUpdate {
    /// Begin, s, or the end of the update before, if later.
    pub from_s: f64,
    /// Update counter.
    pub counter: u32,
    /// Added to the constant coefficient of the law, (L/min)/MPa.
    pub law_c: f64,
    /// Whether the tool has a wrong key.
    #[serde(default)]
    pub wrong_key: bool,
    /// Whether the calibration is for another machine.
    #[serde(default)]
    pub other_machine: bool,
    /// Expected result: `committed`, the name of a reject reason, or `silence`.
    pub expect: String,
    /// Time limit of the result, s.
    pub within_s: f64,
}

/// Expected state of the estimates over a time.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Expectation {
    /// Begin, s.
    pub from_s: f64,
    /// End, s.
    pub until_s: f64,
    /// `valid`: every output has a valid coefficient within `within_se` of its stated standard errors of the true one, and the
    /// law's coefficient lies as close to the true one without wear.
    /// Otherwise the reason that every output must carry, as reports print it: `p_h open`, `n_m implausible`, or of the
    /// operating point: `not_loaded`. Alternatives are separated by `|`.
    pub state: String,
    /// Time within which the state must be reached, s.
    #[serde(default)]
    pub after_s: f64,
    /// Largest error of the coefficient, in stated standard errors.
    #[serde(default = "three")]
    pub within_se: f64,
    /// Of `valid`: largest error of the coefficient, percent of the true one; unbounded when left out.
    #[serde(default)]
    pub within_pct: Option<f64>,
    /// Of `valid`: largest mean error of the coefficient, percent of the true one.
    #[serde(default)]
    pub mean_within_pct: Option<f64>,
    /// Fraction of the outputs that may exceed `within_se` or `within_pct`: of normally distributed ones, 0.3 % exceed three
    /// standard errors.
    #[serde(default = "few")]
    pub may_miss: f64,
}

const fn three() -> f64 {
    3.0
}

const fn few() -> f64 {
    0.003
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct ScenarioFile {
    schema: u32,
    name: String,
    seed: u64,
    vehicle: VehicleModel,
    duration_s: f64,
    at: Vec<DriverCommand>,
    #[serde(default)]
    failure: Vec<SensorFailure>,
    #[serde(default)]
    babble: Vec<BusFlood>,
    #[serde(default)]
    expect: Vec<Expectation>,
    #[serde(default)]
    power_cut: Vec<PowerCut>,
    #[serde(default)]
    update: Vec<ScheduledUpdate>,
    #[serde(default = "minutes")]
    keep_s: u32,
}

const fn minutes() -> u32 {
    600
}

/// A scenario.
#[derive(Debug, Clone, PartialEq)]
pub struct Scenario {
    /// Name.
    pub name: String,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Model that simulates the vehicle.
    pub vehicle: VehicleModel,
    /// Length, s.
    pub duration_s: f64,
    /// Commands, in the order of time.
    pub at: Vec<DriverCommand>,
    /// Sensor failures.
    pub failures: Vec<SensorFailure>,
    /// Floods of the bus.
    pub babble: Vec<BusFlood>,
    /// Expectations.
    pub expects: Vec<Expectation>,
    /// Failures of the supply, in the order of time.
    pub power_cuts: Vec<PowerCut>,
    /// Calibration updates, in the order of time.
    pub updates: Vec<ScheduledUpdate>,
    /// Time between two writes of learned health and of the hours, s.
    pub keep_s: u32,
}

impl Scenario {
    /// Reads a scenario file.
    ///
    /// # Errors
    /// An invalid field, with line, value and allowed range.
    pub fn load(path: &Path) -> Result<Self, InputError> {
        Self::from_toml(&TomlFile::read(path)?)
    }

    /// Parses a scenario.
    ///
    /// # Errors
    /// As [`load`](Self::load).
    pub fn from_toml(file: &TomlFile) -> Result<Self, InputError> {
        let raw: ScenarioFile = file.parse()?;
        file.check(
            "schema",
            f64::from(raw.schema),
            AllowedRange::new(f64::from(SCHEMA), f64::from(SCHEMA), ""),
        )?;
        file.check("duration_s", raw.duration_s, AllowedRange::new(0.01, 7.0 * 86_400.0, "s"))?;
        if raw.at.is_empty() {
            return Err(file.error_at("at", "needs one entry at least"));
        }
        let mut before = f64::NEG_INFINITY;
        for command in &raw.at {
            let check = |what: &str, value: f64, range: AllowedRange| {
                if range.contains(value) {
                    return Ok(());
                }
                let error = file.error_at("at", format!("at {} s: {what} is out of range", command.time_s));
                Err(error.with_value(value).with_allowed(range))
            };
            check(
                "time_s (in order)",
                command.time_s,
                AllowedRange::new(before.max(0.0), raw.duration_s, "s"),
            )?;
            before = command.time_s;
            check("n_p_rpm", command.n_p_rpm, AllowedRange::new(0.0, 4000.0, "r/min"))?;
            check("alpha", command.alpha, AllowedRange::new(-1.0, 1.0, ""))?;
            check("load_nm", command.load_nm, AllowedRange::new(0.0, 1.0e5, "N m"))?;
            check("t_b_c", command.t_b_c, AllowedRange::new(-20.0, 120.0, "degC"))?;
            check("wear", command.wear, AllowedRange::new(0.1, 20.0, ""))?;
        }
        let span = |what: &str, from: f64, until: f64| {
            if from >= 0.0 && until >= from && until <= raw.duration_s {
                return Ok(());
            }
            let error = file.error_at(what, "spans no time of the scenario");
            Err(error.with_value(format!("{from} to {until} s")))
        };
        for failure in &raw.failure {
            span("failure", failure.from_s, failure.until_s)?;
        }
        for babble in &raw.babble {
            span("babble", babble.from_s, babble.until_s)?;
        }
        for cut in &raw.power_cut {
            span("power_cut", cut.from_s, cut.from_s + cut.off_s)?;
            if !RecordKind::ALL.iter().any(|kind| kind.name() == cut.during) {
                return Err(file.error_at("power_cut", "names no record").with_value(&cut.during));
            }
        }
        for update in &raw.update {
            span("update", update.from_s, update.from_s + update.within_s)?;
        }
        file.check("keep_s", f64::from(raw.keep_s), AllowedRange::new(1.0, 86_400.0, "s"))?;
        for expect in &raw.expect {
            span("expect", expect.from_s + expect.after_s, expect.until_s)?;
        }
        Ok(Self {
            name: raw.name,
            seed: raw.seed,
            vehicle: raw.vehicle,
            duration_s: raw.duration_s,
            at: raw.at,
            failures: raw.failure,
            babble: raw.babble,
            expects: raw.expect,
            power_cuts: raw.power_cut,
            updates: raw.update,
            keep_s: raw.keep_s,
        })
    }

    /// The command at a time: linear between its neighbours, constant before the first and after the last.
    #[must_use]
    pub fn command(&self, time_s: f64) -> DriverCommand {
        let after = self.at.partition_point(|command| command.time_s <= time_s);
        match (after.checked_sub(1).and_then(|i| self.at.get(i)), self.at.get(after)) {
            (Some(a), Some(b)) => {
                let share = (time_s - a.time_s) / (b.time_s - a.time_s);
                let between = |from: f64, to: f64| from + (to - from) * share;
                DriverCommand {
                    time_s,
                    n_p_rpm: between(a.n_p_rpm, b.n_p_rpm),
                    alpha: between(a.alpha, b.alpha),
                    load_nm: between(a.load_nm, b.load_nm),
                    t_b_c: between(a.t_b_c, b.t_b_c),
                    wear: between(a.wear, b.wear),
                }
            }
            (Some(only), None) | (None, Some(only)) => DriverCommand { time_s, ..*only },
            (None, None) => {
                DriverCommand { time_s, n_p_rpm: 0.0, alpha: 0.0, load_nm: 0.0, t_b_c: 20.0, wear: 1.0 }
            }
        }
    }
}
