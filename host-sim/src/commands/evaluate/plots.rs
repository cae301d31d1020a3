//! Pictures of a study: measured curves beside those that `docs/health/theory.md` derives.

use std::path::Path;

use kou_estimator::calibration::HealthConfig;

use super::alarms::{Alarms, MISFITS, threshold};
use super::{Coverage, Detection};
use crate::commands::Failure;
use crate::commands::lines::{Lines, Series};
use kou_records::InputError;

/// Draws measured curves beside derived ones.
pub(super) fn draw(
    folder: &Path,
    detections: &[Detection],
    coverage: &Coverage,
    alarms: &[Alarms],
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
    let log = |of: f64| of.log10();
    let mut series = vec![Series::new(
        "derived: at most",
        alarms.iter().filter(|a| a.misfits == 1.0).map(|a| (a.threshold, log(a.derived_per_1000_h))),
    )];
    for misfits in MISFITS {
        let of_it = alarms.iter().filter(|a| a.misfits == misfits);
        // None seen: with 95 % probability there are fewer than three in that time.
        let none_seen = of_it.clone().all(|a| a.reports == 0);
        let name = if none_seen {
            format!("misfit {misfits:.0} times the declared one: none seen, 95 % bound")
        } else {
            format!("misfit {misfits:.0} times the declared one")
        };
        let points = of_it.filter(|a| none_seen || a.reports > 0).map(|a| {
            (a.threshold, log(1000.0 * if none_seen { 3.0 } else { f64::from(a.reports) } / a.hours))
        });
        series.push(Series::new(name, points));
    }
    let false_reports = Lines {
        title: "False reports of a healthy machine against the threshold of the sum",
        x: "threshold, log-likelihood ratio",
        y: "log10 of false reports per 1000 h",
        series,
    };
    for (name, lines) in
        [("health_delay", delay), ("health_coverage", intervals), ("health_false_reports", false_reports)]
    {
        lines.write_csv(&folder.join(format!("{name}.csv")))?;
        lines.draw(&folder.join(format!("{name}.svg")))?;
    }
    Ok(())
}

/// Delay by the derivation in `docs/health/theory.md`: the expected sum reaches the limit.
fn derived_delay_s(health: &HealthConfig, open: f64, share: f64) -> Option<f64> {
    let f = f64::from;
    let (block_s, misfit) = (f64::from(health.block_us) / 1e6, f(health.law_misfit));
    let limit = threshold(health);
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
