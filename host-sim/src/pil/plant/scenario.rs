//! Scenario files: what the driver does, what breaks, and what is expected of the firmware.

use std::path::Path;

use kou_app::storage::RecordKind;
use serde::Deserialize;

use kou_records::{InputError, Range, TomlFile};

/// Version of the format.
const SCHEMA: u32 = 1;

/// What the vehicle is simulated with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Model {
    /// The full model: every piston chamber.
    Full,
    /// The calibration's own reduced model with a lagging motor: for long scenarios, where it is the firmware and not the
    /// estimator's accuracy that is tested.
    Surrogate,
}

/// What the driver commands and what wears at one time; linear in between.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Command {
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

/// How it fails.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Broken wire: no current, no edges, or infinite resistance.
    Open,
    /// Shorted wire.
    Short,
    /// The signal stands still where it is.
    Stuck,
    /// `size` is added, in the sensor's unit; of a pickup, the share of teeth lost.
    Offset,
    /// `size` per second is added; of a pickup, to the share of teeth lost.
    Drift,
    /// Normally distributed noise of standard deviation `size`; of a pickup, glitches per millisecond.
    Noise,
    /// The share `size` of conversions gets no answer, or of edges gets lost.
    DropOut,
}

/// A sensor's failure.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Failure {
    /// Which sensor.
    pub sensor: Sensor,
    /// How.
    pub kind: Kind,
    /// From then, s.
    pub from_s: f64,
    /// Until then, s.
    pub until_s: f64,
    /// How much; see [`Kind`].
    #[serde(default)]
    pub size: f64,
}

/// Others that flood the CAN bus with random frames.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Babble {
    /// From then, s.
    pub from_s: f64,
    /// Until then, s.
    pub until_s: f64,
    /// Frames per millisecond, 8 at most; 250 kbit/s carry two.
    pub frames_per_ms: u32,
}

/// The supply fails in the middle of a write to flash, and comes back.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PowerCut {
    /// In the first write of the record after then, s.
    pub from_s: f64,
    /// Which record: `calibration`, `health`, `faults`, `life`, `update_counter`.
    pub during: String,
    /// After how many bytes of the write, both copies and what moves for them counted.
    pub byte: usize,
    /// How long the supply is away, s.
    #[serde(default = "third")]
    pub off_s: f64,
}

const fn third() -> f64 {
    0.3
}

/// A calibration update over the bus.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Update {
    /// Begun then, or when the one before has ended, s.
    pub from_s: f64,
    /// Its counter.
    pub counter: u32,
    /// Added to the constant coefficient of the law, (L/min)/MPa.
    pub law_c: f64,
    /// Whether the tool has a wrong key.
    #[serde(default)]
    pub wrong_key: bool,
    /// Whether the calibration is for another machine.
    #[serde(default)]
    pub other_machine: bool,
    /// What must come of it: `committed`, the name of a refusal, or `silence`.
    pub expect: String,
    /// Within that time, s.
    pub within_s: f64,
}

/// What the estimates must be over a time.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Expect {
    /// From then, s.
    pub from_s: f64,
    /// Until then, s.
    pub until_s: f64,
    /// `valid`: every output has a valid coefficient that is within `within_se` of its stated standard errors of the truth, and
    /// so has what the law expects there, of the truth without wear.
    /// Else the name of the reason that every output must carry, as reports print it: `p_h open`, `n_m implausible`, or
    /// of the operating point: `not_loaded`. Several, with `|` between them, are allowed in turn.
    pub state: String,
    /// Time that the state may take to come, s.
    #[serde(default)]
    pub after_s: f64,
    /// Stated standard errors that the coefficient may be off.
    #[serde(default = "three")]
    pub within_se: f64,
    /// Of `valid`: percent of the truth that the coefficient of an output may be off; nothing for no such bound.
    #[serde(default)]
    pub within_pct: Option<f64>,
    /// Of `valid`: percent of the truth that the mean of the coefficient may be off.
    #[serde(default)]
    pub mean_within_pct: Option<f64>,
    /// Share of the outputs that may miss `within_se` or `within_pct`: three standard errors leave 0.3 % of normally distributed ones.
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
struct File {
    schema: u32,
    name: String,
    seed: u64,
    vehicle: Model,
    duration_s: f64,
    at: Vec<Command>,
    #[serde(default)]
    failure: Vec<Failure>,
    #[serde(default)]
    babble: Vec<Babble>,
    #[serde(default)]
    expect: Vec<Expect>,
    #[serde(default)]
    power_cut: Vec<PowerCut>,
    #[serde(default)]
    update: Vec<Update>,
    #[serde(default = "minutes")]
    keep_s: u32,
}

const fn minutes() -> u32 {
    600
}

/// A scenario.
#[derive(Debug, Clone, PartialEq)]
pub struct Scenario {
    /// Its name.
    pub name: String,
    /// Where everything random comes from.
    pub seed: u64,
    /// What the vehicle is simulated with.
    pub vehicle: Model,
    /// Length, s.
    pub duration_s: f64,
    /// Commands, in the order of time.
    pub at: Vec<Command>,
    /// Failures.
    pub failures: Vec<Failure>,
    /// Floods of the bus.
    pub babble: Vec<Babble>,
    /// Expectations.
    pub expects: Vec<Expect>,
    /// Failures of the supply, in the order of time.
    pub power_cuts: Vec<PowerCut>,
    /// Calibration updates, in the order of time.
    pub updates: Vec<Update>,
    /// Time between two writes of learned health and of the hours, s.
    pub keep_s: u32,
}

impl Scenario {
    /// Reads a scenario file.
    ///
    /// # Errors
    /// What is wrong with it, with line, value and allowed range.
    pub fn load(path: &Path) -> Result<Self, InputError> {
        Self::from_toml(&TomlFile::read(path)?)
    }

    /// Reads a scenario's text.
    ///
    /// # Errors
    /// As [`load`](Self::load).
    pub fn from_toml(file: &TomlFile) -> Result<Self, InputError> {
        let raw: File = file.parse()?;
        file.check("schema", f64::from(raw.schema), Range::new(f64::from(SCHEMA), f64::from(SCHEMA), ""))?;
        file.check("duration_s", raw.duration_s, Range::new(0.01, 7.0 * 86_400.0, "s"))?;
        if raw.at.is_empty() {
            return Err(file.error_at("at", "needs one entry at least"));
        }
        let mut before = f64::NEG_INFINITY;
        for command in &raw.at {
            let check = |what: &str, value: f64, range: Range| {
                if range.contains(value) {
                    return Ok(());
                }
                let error = file.error_at("at", format!("at {} s: {what} is out of range", command.time_s));
                Err(error.with_value(value).with_allowed(range))
            };
            check("time_s (in order)", command.time_s, Range::new(before.max(0.0), raw.duration_s, "s"))?;
            before = command.time_s;
            check("n_p_rpm", command.n_p_rpm, Range::new(0.0, 4000.0, "r/min"))?;
            check("alpha", command.alpha, Range::new(-1.0, 1.0, ""))?;
            check("load_nm", command.load_nm, Range::new(0.0, 1.0e5, "N m"))?;
            check("t_b_c", command.t_b_c, Range::new(-20.0, 120.0, "degC"))?;
            check("wear", command.wear, Range::new(0.1, 20.0, ""))?;
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
        file.check("keep_s", f64::from(raw.keep_s), Range::new(1.0, 86_400.0, "s"))?;
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
    pub fn command(&self, time_s: f64) -> Command {
        let after = self.at.partition_point(|command| command.time_s <= time_s);
        match (after.checked_sub(1).and_then(|i| self.at.get(i)), self.at.get(after)) {
            (Some(a), Some(b)) => {
                let share = (time_s - a.time_s) / (b.time_s - a.time_s);
                let between = |from: f64, to: f64| from + (to - from) * share;
                Command {
                    time_s,
                    n_p_rpm: between(a.n_p_rpm, b.n_p_rpm),
                    alpha: between(a.alpha, b.alpha),
                    load_nm: between(a.load_nm, b.load_nm),
                    t_b_c: between(a.t_b_c, b.t_b_c),
                    wear: between(a.wear, b.wear),
                }
            }
            (Some(only), None) | (None, Some(only)) => Command { time_s, ..*only },
            (None, None) => {
                Command { time_s, n_p_rpm: 0.0, alpha: 0.0, load_nm: 0.0, t_b_c: 20.0, wear: 1.0 }
            }
        }
    }
}
