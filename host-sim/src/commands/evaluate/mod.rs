//! `host-sim evaluate`: how well health is judged, by Monte Carlo.

mod alarms;
mod plots;

use std::collections::BTreeMap;
use std::path::PathBuf;

use kou_estimator::Calibration;
use kou_estimator::health::Cause;
use serde::Serialize;
use serde_json::{Map, Value, json};

use super::given::Calibrated;
use super::{Failure, print_json, print_text};
use crate::evaluate::{
    Course, DIMENSIONS, Event, Looks, Named, Run, Setting, Share, Tally, faults, quantile,
};
use kou_identify::calibration::SensorClass;
use kou_records::InputError;

/// Judges the judging of health: false alarms, delays, confusion of causes, coverage of standard errors.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Machine and calibration.
    #[command(flatten)]
    pub given: Calibrated,
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
    /// Folder for plots (SVG) and their data (CSV): delay against size, coverage against what is stated, false reports
    /// against the threshold.
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
/// Wear that machines have behind them when learning begins, 1 sigma, where coverage is counted: what the prior of the
/// level says, of which new machines would have nothing.
const WORN_SD: f64 = 0.3;
/// Sizes of leaks, shares of the law.
const LEAKS: [f64; 8] = [0.05, 0.07, 0.1, 0.15, 0.2, 0.3, 0.5, 1.0];
/// Drift per hour.
const DRIFT_PER_H: f64 = 0.01;
/// Nominal probabilities of the intervals that are looked at, with the standard errors on either side.
const NOMINAL: [(f64, f64); 5] = [(0.5, 0.674), (0.683, 1.0), (0.8, 1.282), (0.95, 1.96), (0.99, 2.576)];

#[derive(Debug, Serialize)]
struct Detection {
    share: f64,
    reported: usize,
    runs: usize,
    delay_s_median: Option<f64>,
    delay_s_95: Option<f64>,
    within_60_s: usize,
    within_600_s: usize,
    wear_confirmed: usize,
    sensor_blamed: usize,
    remaining: BTreeMap<String, usize>,
}

impl Detection {
    fn of(share: f64, runs: &[Run]) -> Self {
        let delays: Vec<f64> = runs.iter().filter_map(|r| r.delay_s).collect();
        Self {
            share,
            reported: delays.len(),
            runs: runs.len(),
            delay_s_median: quantile(delays.clone(), runs.len(), 0.5),
            within_60_s: delays.iter().filter(|d| **d <= 60.0).count(),
            within_600_s: delays.iter().filter(|d| **d <= 600.0).count(),
            delay_s_95: quantile(delays, runs.len(), 0.95),
            wear_confirmed: runs.iter().filter(|r| r.wear).count(),
            sensor_blamed: runs.iter().filter(|r| r.sensor).count(),
            remaining: remaining(runs),
        }
    }
}

/// Runs the command.
///
/// # Errors
/// Bad input.
pub fn run(args: &Args) -> Result<(), Failure> {
    let (_, calibration, params) = args.given.read()?;
    for (name, value, range) in [
        ("--hours", args.hours, kou_records::Range::new(1.0, 100_000.0, "h")),
        ("--misfit", args.misfit, kou_records::Range::new(0.0, 0.3, "")),
        ("--oil-ageing-per-h", args.oil_ageing_per_h, kou_records::Range::new(0.0, 0.1, "1/h")),
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
        worn_sd: 0.0,
        seed: args.seed,
    };
    let report = study(args, &setting, &calibration)?;
    if args.json { print_json(&report) } else { print_text(&text(&report)) }
}

/// In how many runs each cause remained at the end.
fn remaining(runs: &[Run]) -> BTreeMap<String, usize> {
    let mut counts = BTreeMap::new();
    for cause in runs.iter().flat_map(|r| &r.remaining) {
        *counts.entry((*cause).to_string()).or_insert(0) += 1;
    }
    counts
}

fn study(args: &Args, setting: &Setting, calibration: &Calibration) -> Result<Value, Failure> {
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "checked to be positive and at most 1e5"
    )]
    let worlds = (args.hours / WORLD_H).ceil() as u64;
    let hours_each = args.hours / worlds as f64;
    let healthy = setting.runs(worlds, hours_each);
    let sum = |of: fn(&Run) -> f64| healthy.iter().map(of).sum::<f64>();
    let worn = Setting { worn_sd: WORN_SD, ..setting.clone() };
    let coverage = Coverage::of(&worn.runs(COVERAGE_WORLDS * args.runs, COVERAGE_H));
    let open = sum(|r| r.gate_open_s) / sum(|r| r.judged_s).max(1.0);

    let named = faults(&setting.params, &calibration.oil).map_err(|e| {
        InputError::new(format!("no air can be added to its oil: {e}")).at_file(&args.given.calibration)
    })?;
    let courses = courses(&named);
    let mut results = setting.courses(args.runs, &courses).into_iter();
    let detections: Vec<Detection> =
        LEAKS.iter().zip(results.by_ref()).map(|(share, runs)| Detection::of(*share, &runs)).collect();
    let confusion: Map<String, Value> = named
        .iter()
        .zip(results.by_ref())
        .map(|(fault, runs)| (fault.name.into(), confusion(fault, &runs)))
        .collect();
    let drift = results.next().unwrap_or_default();
    let levels: Vec<f64> = drift.iter().filter_map(|r| r.level_at_report).collect();
    if let Some(folder) = &args.plots {
        let alarms = alarms::measure(setting, calibration, args.hours)?;
        plots::draw(folder, &detections, &coverage, &alarms, &calibration.health, open)?;
    }
    Ok(json!({
        "healthy_hours": args.hours,
        "false_changes_per_1000_h": 1000.0 * sum(|r| f64::from(r.false_changes)) / args.hours,
        "false_wear_worlds": healthy.iter().filter(|r| r.false_wear).count(),
        "gate_open_of_judged": open,
        "coverage_worlds": COVERAGE_WORLDS * args.runs,
        "coverage_95": { "level": &coverage.of_level, "kou": &coverage.of_kou },
        "level_error_rms": coverage.level_error_rms,
        "detection": detections,
        "drift_1_pct_per_h": {
            "runs": drift.len(),
            "reported": levels.len(),
            "level_at_report_median": quantile(levels.clone(), drift.len(), 0.5),
            "level_at_report_95": quantile(levels.clone(), drift.len(), 0.95),
            "level_at_report_largest": levels.iter().copied().reduce(f64::max),
        },
        "faults": confusion,
    }))
}

/// Leaks, faults and the drift, in this order.
fn courses(faults: &[Named]) -> Vec<Course> {
    let wear = |event, hours, until_report| Course { event, hours, until_report, cause: Cause::Wear };
    let leaks = LEAKS.iter().map(|share| wear(Event::Leak { share: *share, within_s: 60.0 }, AFTER_H, false));
    let faults = faults.iter().map(|fault| Course {
        event: fault.event.clone(),
        hours: AFTER_H,
        until_report: false,
        cause: fault.cause,
    });
    let drift = wear(Event::Drift { per_h: DRIFT_PER_H }, DRIFT_H, true);
    leaks.chain(faults).chain([drift]).collect()
}

/// What was made of a fault.
fn confusion(fault: &Named, runs: &[Run]) -> Value {
    json!({
        "cause": fault.cause.name(),
        "runs": runs.len(),
        "reported": runs.iter().filter(|r| r.delay_s.is_some()).count(),
        "wear_confirmed": runs.iter().filter(|r| r.wear).count(),
        "sensor_blamed": runs.iter().filter(|r| r.sensor).count(),
        "ever_named_causes_without_it": runs.iter().filter(|r| r.misled).count(),
        "remaining": remaining(runs),
    })
}

/// How often the 95 % intervals of one quantity held the truth.
#[derive(Debug, Serialize)]
struct Shares {
    all: Share,
    first_quarter_hour: Share,
    first_90_min: Share,
    later: Share,
    /// Lower, middle and upper third of each dimension.
    by_third: BTreeMap<&'static str, [Share; 3]>,
}

impl Shares {
    fn of(runs: &[Run], looks: fn(&Run) -> &Looks) -> Self {
        let over = |of: &dyn Fn(&Looks) -> Tally| Share::over(runs.iter().map(|r| of(looks(r))));
        let third = |dimension: usize, third: usize| {
            over(&|l| l.by_region.get(dimension).and_then(|t| t.get(third)).copied().unwrap_or_default())
        };
        let dimensions = DIMENSIONS.iter().enumerate();
        Self {
            all: over(&Looks::all),
            first_quarter_hour: over(&|l| l.by_time[0]),
            first_90_min: over(&Looks::early),
            later: over(&Looks::late),
            by_third: dimensions.map(|(i, name)| (*name, [0, 1, 2].map(|k| third(i, k)))).collect(),
        }
    }
}

/// How often intervals held the truth.
struct Coverage {
    of_level: Shares,
    of_kou: Shares,
    level_error_rms: f64,
    /// Nominal probability and share, of the level at the end.
    level: Vec<(f64, f64)>,
}

impl Coverage {
    fn of(runs: &[Run]) -> Self {
        let looks = runs.iter().map(|r| f64::from(r.level.all().looks)).sum::<f64>().max(1.0);
        let ratios: Vec<f64> = runs.iter().filter_map(|r| r.level_error_in_se).collect();
        let within = |se: f64| ratios.iter().filter(|z| z.abs() <= se).count() as f64 / ratios.len() as f64;
        Self {
            of_level: Shares::of(runs, |r| &r.level),
            of_kou: Shares::of(runs, |r| &r.kou),
            level_error_rms: (runs.iter().map(|r| r.level_error2).sum::<f64>() / looks).sqrt(),
            level: NOMINAL.iter().map(|(nominal, se)| (*nominal, within(*se))).collect(),
        }
    }
}

fn text(report: &Value) -> String {
    serde_json::to_string_pretty(report).unwrap_or_default()
}
