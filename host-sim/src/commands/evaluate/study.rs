//! The evaluation: healthy drives, coverage of intervals, leaks, faults and a drift.

use std::path::Path;

use kou_estimator::Calibration;
use kou_estimator::health::Cause;
use serde_json::{Map, Value, json};

use super::alarms;
use super::plots;
use super::results::{IntervalCoverage, LeakDetection, confusion};
use crate::commands::failure::Failure;
use crate::evaluate::{DriveEvent, FaultCase, TrialCase, TrialResult, TrialSettings, fault_cases, quantile};
use kou_records::InputError;

/// Hours of each healthy drive.
const DRIVE_H: f64 = 50.0;
/// Hours after an event.
const AFTER_H: f64 = 1.0;
/// Drives over which coverage is counted, for each of `--runs`: one drive is one draw of the systematic errors.
const COVERAGE_DRIVES: u64 = 10;
/// Hours of each.
const COVERAGE_H: f64 = 2.0;
/// Hours of a drive with a drift.
const DRIFT_H: f64 = 15.0;
/// Wear of the machines when learning begins, 1 sigma, where coverage is counted: that of the level's prior.
const WORN_SD: f64 = 0.3;
/// Sizes of leaks, as fractions of the law's leakage.
const LEAKS: [f64; 8] = [0.05, 0.07, 0.1, 0.15, 0.2, 0.3, 0.5, 1.0];
/// Drift per hour.
const DRIFT_PER_H: f64 = 0.01;

/// Size of an evaluation, and its files.
pub(super) struct StudyPlan<'a> {
    /// Hours of healthy driving, over all drives.
    pub(super) hours: f64,
    /// Drives for each size of leak and each fault.
    pub(super) runs: u64,
    /// Folder for plots.
    pub(super) plots: Option<&'a Path>,
    /// File of the calibration, for errors.
    pub(super) calibration: &'a Path,
}

/// Runs the evaluation.
pub(super) fn study(
    plan: &StudyPlan<'_>,
    settings: &TrialSettings,
    calibration: &Calibration,
) -> Result<Value, Failure> {
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "checked to be positive and at most 1e5"
    )]
    let drives = (plan.hours / DRIVE_H).ceil() as u64;
    let hours_each = plan.hours / drives as f64;
    let healthy = settings.run_healthy_many(drives, hours_each);
    let sum = |of: fn(&TrialResult) -> f64| healthy.iter().map(of).sum::<f64>();
    let worn = TrialSettings { worn_sd: WORN_SD, ..settings.clone() };
    let coverage = IntervalCoverage::of(&worn.run_healthy_many(COVERAGE_DRIVES * plan.runs, COVERAGE_H));
    let open = sum(|r| r.gate_open_s) / sum(|r| r.judged_s).max(1.0);

    let named = fault_cases(&settings.params, &calibration.oil).map_err(|e| {
        InputError::new(format!("no air can be added to its oil: {e}")).at_file(plan.calibration)
    })?;
    let cases = cases(&named);
    let mut results = settings.run_cases(plan.runs, &cases).into_iter();
    let detections: Vec<LeakDetection> =
        LEAKS.iter().zip(results.by_ref()).map(|(share, runs)| LeakDetection::of(*share, &runs)).collect();
    let confusion: Map<String, Value> = named
        .iter()
        .zip(results.by_ref())
        .map(|(fault, runs)| (fault.name.into(), confusion(fault, &runs)))
        .collect();
    let drift = results.next().unwrap_or_default();
    let levels: Vec<f64> = drift.iter().filter_map(|r| r.level_at_report).collect();
    if let Some(folder) = plan.plots {
        let alarms = alarms::measure(settings, calibration, plan.hours)?;
        plots::draw(folder, &detections, &coverage, &alarms, &calibration.health, open)?;
    }
    Ok(json!({
        "healthy_hours": plan.hours,
        "false_changes_per_1000_h": 1000.0 * sum(|r| f64::from(r.false_changes)) / plan.hours,
        "false_wear_worlds": healthy.iter().filter(|r| r.false_wear).count(),
        "gate_open_of_judged": open,
        "coverage_worlds": COVERAGE_DRIVES * plan.runs,
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
fn cases(faults: &[FaultCase]) -> Vec<TrialCase> {
    let wear = |event, hours, until_report| TrialCase { event, hours, until_report, cause: Cause::Wear };
    let leaks =
        LEAKS.iter().map(|share| wear(DriveEvent::Leak { share: *share, within_s: 60.0 }, AFTER_H, false));
    let faults = faults.iter().map(|fault| TrialCase {
        event: fault.event.clone(),
        hours: AFTER_H,
        until_report: false,
        cause: fault.cause,
    });
    let drift = wear(DriveEvent::Drift { per_h: DRIFT_PER_H }, DRIFT_H, true);
    leaks.chain(faults).chain([drift]).collect()
}
