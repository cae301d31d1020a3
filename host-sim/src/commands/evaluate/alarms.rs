//! False reports of healthy machines against the threshold from which a step is reported.
//!
//! At the stated average run length between false alarms (ARL0) none occurs in any time that can be simulated. So thresholds
//! of shorter run lengths are tried, and machines that deviate from the law by more than is declared, which the derivation
//! does not cover.

use kou_estimator::calibration::HealthConfig;
use kou_estimator::{Calibration, Params};

use crate::commands::failure::Failure;
use crate::evaluate::TrialSettings;
use kou_records::InputError;

/// Run lengths tried, in hours.
const FALSE_ALARM_INTERVALS_H: [f32; 5] = [1.0, 10.0, 100.0, 1000.0, 1e5];
/// Misfits of the simulated machines over the declared one.
pub(super) const MISFITS: [f64; 3] = [1.0, 2.0, 3.0];
/// Fraction of the hours of healthy driving for each point.
const HOURS_SHARE: f64 = 0.2;
/// Drives for each point.
const DRIVES: u64 = 20;

/// False reports at one threshold.
pub(super) struct Alarms {
    /// Misfit over the declared one.
    pub(super) misfits: f64,
    /// Threshold, a log-likelihood ratio.
    pub(super) threshold: f64,
    /// Upper bound of false reports per 1000 h by the derivation.
    pub(super) derived_per_1000_h: f64,
    /// False reports.
    pub(super) reports: u32,
    /// Hours driven.
    pub(super) hours: f64,
}

/// Sum of log-likelihood ratios at which a step is reported, by the derivation in `docs/health/theory.md`.
pub(super) fn threshold(health: &HealthConfig) -> f64 {
    let f = f64::from;
    let decision_h = f64::from(health.block_us) / 3.6e9 * f(health.misfit_blocks);
    (2.0 * f(health.false_alarm_interval_h) / decision_h).ln().max(3.0)
}

/// Drives healthy machines at each threshold.
pub(super) fn measure(
    settings: &TrialSettings,
    calibration: &Calibration,
    hours: f64,
) -> Result<Vec<Alarms>, Failure> {
    let hours_each = (HOURS_SHARE * hours / DRIVES as f64).max(0.5);
    let mut alarms = Vec::new();
    for misfits in MISFITS {
        for false_alarm_interval_h in FALSE_ALARM_INTERVALS_H {
            let mut tried = calibration.clone();
            tried.health.false_alarm_interval_h = false_alarm_interval_h;
            let params = Params::new(&tried).map_err(|e| InputError::new(e.to_string()))?;
            let misfit = misfits * f64::from(calibration.health.law_misfit);
            let runs =
                TrialSettings { params, misfit, ..settings.clone() }.run_healthy_many(DRIVES, hours_each);
            alarms.push(Alarms {
                misfits,
                threshold: threshold(&tried.health),
                derived_per_1000_h: 1000.0 / f64::from(false_alarm_interval_h),
                reports: runs.iter().map(|r| r.false_changes).sum(),
                hours: DRIVES as f64 * hours_each,
            });
        }
    }
    Ok(alarms)
}
