//! `host-sim evaluate`: how well health is judged, by Monte Carlo.

use std::path::PathBuf;

use serde::Serialize;
use serde_json::{Map, Value, json};

use super::{Failure, print_json, print_text};
use crate::calibration::{self, SensorClass};
use crate::evaluate::{COMMISSIONING_H, Event, Fault, Run, Setting, quantile};
use crate::input::InputError;
use crate::machine::Machine;

/// Judges the judging of health: false alarms, delays, confusion of causes, coverage of standard errors.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Machine file (TOML); it must be the calibration's.
    #[arg(long, value_name = "M.toml")]
    pub machine: PathBuf,
    /// Calibration: TOML or binary record.
    #[arg(long, value_name = "CAL.toml")]
    pub calibration: PathBuf,
    /// Hours of healthy driving, over all worlds together.
    #[arg(long, default_value_t = 200.0)]
    pub hours: f64,
    /// Worlds for each size of change and each fault.
    #[arg(long, default_value_t = 20)]
    pub runs: u64,
    /// Seed of the first world.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Class of the simulated sensors.
    #[arg(long, value_enum, default_value = "B")]
    pub class: SensorClass,
    /// Misfit of the law over operating points, relative, 1 sigma.
    #[arg(long, default_value_t = 0.02)]
    pub misfit: f64,
    /// Rise of leakage by ageing of the oil, per hour.
    #[arg(long, default_value_t = 0.0)]
    pub oil_ageing_per_h: f64,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

/// Hours of each world of healthy driving.
const WORLD_H: f64 = 50.0;
/// Hours after an event.
const AFTER_H: f64 = 1.0;

#[derive(Debug, Serialize)]
struct Detection {
    share: f64,
    reported: usize,
    runs: usize,
    delay_s_median: Option<f64>,
    delay_s_95: Option<f64>,
    wear_confirmed: usize,
    sensor_blamed: usize,
}

impl Detection {
    fn of(share: f64, runs: &[Run]) -> Self {
        let delays: Vec<f64> = runs.iter().filter_map(|r| r.delay_s).collect();
        Self {
            share,
            reported: delays.len(),
            runs: runs.len(),
            delay_s_median: quantile(delays.clone(), runs.len(), 0.5),
            delay_s_95: quantile(delays, runs.len(), 0.95),
            wear_confirmed: runs.iter().filter(|r| r.wear).count(),
            sensor_blamed: runs.iter().filter(|r| r.sensor).count(),
        }
    }
}

/// Runs the command.
///
/// # Errors
/// Bad input.
pub fn run(args: &Args) -> Result<(), Failure> {
    let machine = Machine::load(&args.machine)?;
    let (calibration, params) = calibration::read_checked(&args.calibration)?;
    if calibration.machine.name.as_str() != machine.name() {
        return Err(InputError::new("is of another machine than the machine file")
            .at_file(&args.calibration)
            .with_value(&calibration.machine.name)
            .with_allowed(machine.name())
            .into());
    }
    for (name, value, range) in [
        ("--hours", args.hours, crate::input::Range::new(1.0, 100_000.0, "h")),
        ("--misfit", args.misfit, crate::input::Range::new(0.0, 0.3, "")),
        ("--oil-ageing-per-h", args.oil_ageing_per_h, crate::input::Range::new(0.0, 0.1, "1/h")),
    ] {
        if !range.contains(value) {
            return Err(InputError::new(format!("{name} is out of range"))
                .with_value(value)
                .with_allowed(range)
                .into());
        }
    }
    let law = &calibration.law;
    let setting = Setting {
        params,
        limits: [law.n_max.get().into(), law.p_max.get().into(), law.t_max.get().into()],
        class: args.class,
        misfit: args.misfit,
        oil_ageing_per_h: args.oil_ageing_per_h,
        seed: args.seed,
    };
    let report = study(args, &setting);
    if args.json { print_json(&report) } else { print_text(&text(&report)) }
}

fn study(args: &Args, setting: &Setting) -> Value {
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "checked to be positive and at most 1e5"
    )]
    let worlds = (args.hours / WORLD_H).ceil() as u64;
    let hours_each = args.hours / worlds as f64;
    let healthy = setting.runs(worlds, hours_each, None);
    let sum = |of: fn(&Run) -> u32| healthy.iter().map(|r| f64::from(of(r))).sum::<f64>();
    let level_looks = sum(|r| r.level_looks).max(1.0);
    let hours = COMMISSIONING_H + AFTER_H;
    let detections: Vec<Detection> = [0.05, 0.1, 0.15, 0.2, 0.3, 0.5, 1.0]
        .into_iter()
        .map(|share| {
            Detection::of(share, &setting.runs(args.runs, hours, Some(Event::Leak { share, within_s: 60.0 })))
        })
        .collect();
    let mut confusion = Map::new();
    for (name, fault) in faults(setting) {
        let runs = setting.runs(args.runs, hours, Some(Event::Sensor(fault)));
        confusion.insert(
            name.into(),
            json!({
                "runs": runs.len(),
                "reported": runs.iter().filter(|r| r.delay_s.is_some()).count(),
                "wear_confirmed": runs.iter().filter(|r| r.wear).count(),
                "sensor_blamed": runs.iter().filter(|r| r.sensor).count(),
                "remaining_in_first_run": runs.first().map(|r| &r.remaining),
            }),
        );
    }
    json!({
        "healthy_hours": args.hours,
        "false_changes_per_1000_h": 1000.0 * sum(|r| r.false_changes) / args.hours,
        "false_wear_worlds": healthy.iter().filter(|r| r.false_wear).count(),
        "coverage_level_95": sum(|r| r.level_hits) / level_looks,
        "coverage_kou_95": sum(|r| r.kou_hits) / sum(|r| r.kou_looks).max(1.0),
        "level_error_rms": (healthy.iter().map(|r| r.level_error2).sum::<f64>() / level_looks).sqrt(),
        "detection": detections,
        "faults_of_2_pct_of_span": confusion,
    })
}

/// Offsets of 2 % of each sensor's span, both ways.
pub fn faults(setting: &Setting) -> Vec<(&'static str, Fault)> {
    let ranges = setting.params.sensor_ranges();
    let speed = 0.02 * f64::from(ranges.speed_max.get());
    let pressure = 0.02 * f64::from(ranges.pressure_max.get() - ranges.pressure_min.get());
    let temperature = 0.02 * f64::from(ranges.temperature_max.get() - ranges.temperature_min.get());
    vec![
        ("pressure_up", Fault::PressureOffset(pressure)),
        ("pressure_down", Fault::PressureOffset(-pressure)),
        ("temperature_up", Fault::TemperatureOffset(temperature)),
        ("temperature_down", Fault::TemperatureOffset(-temperature)),
        ("pump_speed_up", Fault::PumpSpeedOffset(speed)),
        ("pump_speed_down", Fault::PumpSpeedOffset(-speed)),
        ("motor_speed_up", Fault::MotorSpeedOffset(speed)),
        ("motor_speed_down", Fault::MotorSpeedOffset(-speed)),
        // Span -1 to 1.
        ("displacement_down", Fault::DisplacementOffset(-0.04)),
    ]
}

fn text(report: &Value) -> String {
    serde_json::to_string_pretty(report).unwrap_or_default()
}
