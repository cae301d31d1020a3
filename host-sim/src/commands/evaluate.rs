//! `host-sim evaluate`: how well health is judged, by Monte Carlo.

use std::path::{Path, PathBuf};

use kou_estimator::health::HealthConfig;
use serde::Serialize;
use serde_json::{Map, Value, json};

use super::lines::{Lines, Series};
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
    /// Folder for plots (SVG) and their data (CSV): delay against size, coverage against what is stated.
    #[arg(long, value_name = "DIR")]
    pub plots: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

/// Hours of each world of healthy driving.
const WORLD_H: f64 = 50.0;
/// Hours after an event.
const AFTER_H: f64 = 1.0;
/// Worlds over which coverage is counted, for each run asked for: one world is one draw of the systematic errors.
const COVERAGE_WORLDS: u64 = 10;
/// Hours of each.
const COVERAGE_H: f64 = 2.0;
/// Hours in which a drift is looked for.
const DRIFT_H: f64 = 15.0;
/// Nominal probabilities of the intervals that are looked at, with the standard errors on either side.
const NOMINAL: [(f64, f64); 5] = [(0.5, 0.674), (0.683, 1.0), (0.8, 1.282), (0.95, 1.96), (0.99, 2.576)];

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
    let report = study(args, &setting, calibration.health)?;
    if args.json { print_json(&report) } else { print_text(&text(&report)) }
}

fn study(args: &Args, setting: &Setting, health: HealthConfig) -> Result<Value, Failure> {
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "checked to be positive and at most 1e5"
    )]
    let worlds = (args.hours / WORLD_H).ceil() as u64;
    let hours_each = args.hours / worlds as f64;
    let healthy = setting.runs(worlds, hours_each, None);
    let sum = |of: fn(&Run) -> f64| healthy.iter().map(of).sum::<f64>();
    let coverage = Coverage::of(&setting.runs(COVERAGE_WORLDS * args.runs, COVERAGE_H, None));
    let open = sum(|r| r.gate_open_s) / sum(|r| r.judged_s).max(1.0);
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
    let drift = setting.runs(args.runs, COMMISSIONING_H + DRIFT_H, Some(Event::Drift { per_h: 0.01 }));
    let levels: Vec<f64> = drift.iter().filter_map(|r| r.level_at_report).collect();
    if let Some(folder) = &args.plots {
        plot(folder, &detections, &coverage, &health, open)?;
    }
    Ok(json!({
        "healthy_hours": args.hours,
        "false_changes_per_1000_h": 1000.0 * sum(|r| f64::from(r.false_changes)) / args.hours,
        "false_wear_worlds": healthy.iter().filter(|r| r.false_wear).count(),
        "gate_open_of_judged": open,
        "coverage_worlds": COVERAGE_WORLDS * args.runs,
        "coverage_level_95": coverage.level_95,
        "coverage_kou_95": coverage.kou_95,
        "level_error_rms": coverage.level_error_rms,
        "detection": detections,
        "drift_1_pct_per_h": {
            "runs": drift.len(),
            "reported": levels.len(),
            "level_at_report_median": quantile(levels.clone(), drift.len(), 0.5),
            "level_at_report_95": quantile(levels, drift.len(), 0.95),
        },
        "faults_of_2_pct_of_span": confusion,
    }))
}

/// How often intervals held the truth.
struct Coverage {
    level_95: f64,
    kou_95: f64,
    level_error_rms: f64,
    /// Nominal probability and share, of the level.
    level: Vec<(f64, f64)>,
}

impl Coverage {
    fn of(runs: &[Run]) -> Self {
        let sum = |of: fn(&Run) -> f64| runs.iter().map(of).sum::<f64>();
        let looks = sum(|r| f64::from(r.level_looks)).max(1.0);
        let ratios: Vec<f64> = runs.iter().filter_map(|r| r.level_error_in_se).collect();
        let within = |se: f64| ratios.iter().filter(|z| z.abs() <= se).count() as f64 / ratios.len() as f64;
        Self {
            level_95: sum(|r| f64::from(r.level_hits)) / looks,
            kou_95: sum(|r| f64::from(r.kou_hits)) / sum(|r| f64::from(r.kou_looks)).max(1.0),
            level_error_rms: (sum(|r| r.level_error2) / looks).sqrt(),
            level: NOMINAL.iter().map(|(nominal, se)| (*nominal, within(*se))).collect(),
        }
    }
}

/// Draws measured curves beside derived ones.
fn plot(
    folder: &Path,
    detections: &[Detection],
    coverage: &Coverage,
    health: &HealthConfig,
    open: f64,
) -> Result<(), Failure> {
    std::fs::create_dir_all(folder)
        .map_err(|e| InputError::new(format!("cannot be made: {e}")).at_file(folder))?;
    let measured = |of: fn(&Detection) -> Option<f64>| {
        detections.iter().filter_map(move |d| Some((100.0 * d.share, of(d)?)))
    };
    let shares = (6..=100).map(|i| f64::from(i) / 100.0);
    let derived = shares.filter_map(|share| Some((100.0 * share, derived_delay_s(health, open, share)?)));
    let delay = Lines {
        title: "Delay from the onset of a leak that grows within a minute to its report",
        x: "change of leakage, %",
        y: "judged driving, s",
        series: vec![
            Series::new("median of runs", measured(|d| d.delay_s_median)),
            Series::new("95 % of runs", measured(|d| d.delay_s_95)),
            Series::new("derived", derived.filter(|(_, delay)| *delay < 300.0)),
        ],
    };
    let intervals = Lines {
        title: "Intervals of the level: how often they hold the truth",
        x: "nominal probability",
        y: "share of worlds",
        series: vec![
            Series::new("measured", coverage.level.iter().copied()),
            Series::new("as stated", coverage.level.iter().map(|(nominal, _)| (*nominal, *nominal))),
        ],
    };
    for (name, lines) in [("health_delay", delay), ("health_coverage", intervals)] {
        lines.write_csv(&folder.join(format!("{name}.csv")))?;
        lines.draw(&folder.join(format!("{name}.svg")))?;
    }
    Ok(())
}

/// Delay by the derivation in `docs/health.md`: the expected sum reaches the limit.
fn derived_delay_s(health: &HealthConfig, open: f64, share: f64) -> Option<f64> {
    let f = f64::from;
    let (block_s, misfit) = (f64::from(health.block_us) / 1e6, f(health.law_misfit));
    let decisions = f(health.run_length_h) * 3600.0 / (block_s * f(health.misfit_blocks));
    let limit = (2.0 * decisions).ln();
    let largest = 2.0 * limit / f(health.misfit_blocks);
    let noise2 = misfit * misfit * f(health.misfit_blocks);
    let design = 2.0 * f(health.report_change);
    let mut sum = 0.0_f64;
    (1..7200).find_map(|i| {
        let t_s = f64::from(i) * block_s;
        let level = share * (t_s / 60.0).min(1.0);
        let part = (design * (level - 0.5 * design) / noise2).clamp(-largest, largest);
        sum = (sum + open * part).max(0.0);
        (sum >= limit).then_some(t_s)
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
