//! Results of an evaluation: detection of leaks, confusion of causes, coverage of intervals.

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::{Value, json};

use crate::evaluate::{
    CoverageCounts, CoverageShare, DIMENSIONS, FaultCase, HitCount, TrialResult, quantile,
};

/// Nominal probabilities of intervals, with their half widths in standard errors.
const NOMINAL: [(f64, f64); 5] = [(0.5, 0.674), (0.683, 1.0), (0.8, 1.282), (0.95, 1.96), (0.99, 2.576)];

#[derive(Debug, Serialize)]
pub(super) struct LeakDetection {
    pub(super) share: f64,
    pub(super) reported: usize,
    pub(super) runs: usize,
    pub(super) delay_s_median: Option<f64>,
    pub(super) delay_s_95: Option<f64>,
    pub(super) within_60_s: usize,
    pub(super) within_600_s: usize,
    pub(super) wear_confirmed: usize,
    pub(super) sensor_blamed: usize,
    pub(super) remaining: BTreeMap<String, usize>,
}

impl LeakDetection {
    pub(super) fn of(share: f64, runs: &[TrialResult]) -> Self {
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

/// Number of trials in which each cause remained at the end.
fn remaining(runs: &[TrialResult]) -> BTreeMap<String, usize> {
    let mut counts = BTreeMap::new();
    for cause in runs.iter().flat_map(|r| &r.remaining) {
        *counts.entry((*cause).to_string()).or_insert(0) += 1;
    }
    counts
}

/// Diagnosis of a fault.
pub(super) fn confusion(fault: &FaultCase, runs: &[TrialResult]) -> Value {
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

/// Coverage of one quantity's 95 % interval.
#[derive(Debug, Serialize)]
pub(super) struct CoverageShares {
    pub(super) all: CoverageShare,
    pub(super) first_quarter_hour: CoverageShare,
    pub(super) first_90_min: CoverageShare,
    pub(super) later: CoverageShare,
    /// Lower, middle and upper third of each dimension.
    pub(super) by_third: BTreeMap<&'static str, [CoverageShare; 3]>,
}

impl CoverageShares {
    pub(super) fn of(runs: &[TrialResult], looks: fn(&TrialResult) -> &CoverageCounts) -> Self {
        let over =
            |of: &dyn Fn(&CoverageCounts) -> HitCount| CoverageShare::over(runs.iter().map(|r| of(looks(r))));
        let third = |dimension: usize, third: usize| {
            over(&|l| l.by_region.get(dimension).and_then(|t| t.get(third)).copied().unwrap_or_default())
        };
        let dimensions = DIMENSIONS.iter().enumerate();
        Self {
            all: over(&CoverageCounts::all),
            first_quarter_hour: over(&|l| l.by_time[0]),
            first_90_min: over(&CoverageCounts::early),
            later: over(&CoverageCounts::late),
            by_third: dimensions.map(|(i, name)| (*name, [0, 1, 2].map(|k| third(i, k)))).collect(),
        }
    }
}

/// Coverage of all intervals.
pub(super) struct IntervalCoverage {
    pub(super) of_level: CoverageShares,
    pub(super) of_kou: CoverageShares,
    pub(super) level_error_rms: f64,
    /// Nominal probability and share, of the level at the end.
    pub(super) level: Vec<(f64, f64)>,
}

impl IntervalCoverage {
    pub(super) fn of(runs: &[TrialResult]) -> Self {
        let looks = runs.iter().map(|r| f64::from(r.level.all().looks)).sum::<f64>().max(1.0);
        let ratios: Vec<f64> = runs.iter().filter_map(|r| r.level_error_in_se).collect();
        let within = |se: f64| ratios.iter().filter(|z| z.abs() <= se).count() as f64 / ratios.len() as f64;
        Self {
            of_level: CoverageShares::of(runs, |r| &r.level),
            of_kou: CoverageShares::of(runs, |r| &r.kou),
            level_error_rms: (runs.iter().map(|r| r.level_error2).sum::<f64>() / looks).sqrt(),
            level: NOMINAL.iter().map(|(nominal, se)| (*nominal, within(*se))).collect(),
        }
    }
}
