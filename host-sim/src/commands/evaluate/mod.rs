//! `host-sim evaluate`: health monitoring by Monte Carlo.

mod alarms;
mod plots;
mod results;
mod study;

use std::path::PathBuf;

use serde_json::Value;

use super::calibrated_args::CalibratedArgs;
use super::class_arg::ClassArg;
use super::failure::Failure;
use super::output::{print_json, print_text};
use crate::evaluate::TrialSettings;
use kou_records::InputError;
use study::{StudyPlan, study};

/// Evaluates health monitoring on simulated drives: false alarms, delays, confusion of causes, coverage of intervals.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Machine and calibration.
    #[command(flatten)]
    pub given: CalibratedArgs,
    /// Hours of healthy driving, over all drives.
    #[arg(long, default_value_t = 200.0)]
    pub hours: f64,
    /// Drives for each size of leak and each fault.
    #[arg(long, default_value_t = 20)]
    pub runs: u64,
    /// Seed of the first drive.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Class of the simulated sensors.
    #[arg(long, value_enum, default_value = "B")]
    pub class: ClassArg,
    /// Misfit of the law over operating points, relative, 1 sigma.
    #[arg(long, default_value_t = 0.02)]
    pub misfit: f64,
    /// Rise of leakage by ageing of the oil, per hour.
    #[arg(long, default_value_t = 0.0)]
    pub oil_ageing_per_h: f64,
    /// Folder for plots (SVG) and their data (CSV): delay over size, measured over nominal coverage, false reports over the
    /// threshold.
    #[arg(long, value_name = "DIR")]
    pub plots: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

/// Runs the command.
///
/// # Errors
/// Bad input.
pub fn run(args: &Args) -> Result<(), Failure> {
    let (_, calibration, params) = args.given.read()?;
    for (name, value, range) in [
        ("--hours", args.hours, kou_records::AllowedRange::new(1.0, 100_000.0, "h")),
        ("--misfit", args.misfit, kou_records::AllowedRange::new(0.0, 0.3, "")),
        ("--oil-ageing-per-h", args.oil_ageing_per_h, kou_records::AllowedRange::new(0.0, 0.1, "1/h")),
    ] {
        if !range.contains(value) {
            return Err(InputError::new(format!("{name} is out of range"))
                .with_value(value)
                .with_allowed(range)
                .into());
        }
    }
    let law = &calibration.law;
    let settings = TrialSettings {
        params,
        limits: [law.n_max.get().into(), law.p_max.get().into(), law.t_max.get().into()],
        class: args.class.into(),
        misfit: args.misfit,
        oil_ageing_per_h: args.oil_ageing_per_h,
        worn_sd: 0.0,
        seed: args.seed,
    };
    let plan = StudyPlan {
        hours: args.hours,
        runs: args.runs,
        plots: args.plots.as_deref(),
        calibration: &args.given.calibration,
    };
    let report = study(&plan, &settings, &calibration)?;
    if args.json { print_json(&report) } else { print_text(&text(&report)) }
}

fn text(report: &Value) -> String {
    serde_json::to_string_pretty(report).unwrap_or_default()
}
