//! The charts of a report: the paper's figures 8, 12, 13, 14 and 16 for this machine, and residuals.

use crate::synth::viscosity_mm2_s;
use kou_identify::{Identification, PointResult, normalised, phi};
use kou_lumped::machine::Machine;
use kou_records::BenchPoint;

use super::study::{ReportStudy, extent};
use crate::plots::{Chart, DataPoint, Marks, Series};

/// Every chart, in the order of the page.
pub fn all(machine: &Machine, study: &ReportStudy) -> Vec<Chart> {
    let mut charts = vec![fig8(study), fig12_kou(study), fig12_ratio(study), fig13(study)];
    charts.extend(fig14(study));
    charts.extend([fig16(machine, study), residual_ratio(study), residual_kou(study), leave_one_out(study)]);
    charts
}

fn fig8(study: &ReportStudy) -> Chart {
    Chart::new(
        format!("Ratio over pressure at {:.0} r/min (paper fig. 8)", study.fig8_rpm),
        "high pressure, MPa",
        "speed ratio",
        vec![
            Series::line("without leakage", study.fig8.iter().map(|p| (p.0, p.1))),
            Series::line("with leakage by the law", study.fig8.iter().map(|p| (p.0, p.2))),
        ],
    )
}

/// Values over their number, counted from 1.
fn numbered(values: impl Iterator<Item = f64>) -> impl Iterator<Item = (f64, f64)> {
    values.enumerate().map(|(i, value)| (i as f64 + 1.0, value))
}

fn fig12(study: &ReportStudy, pick: fn(&(f64, f64)) -> f64) -> Vec<Series> {
    let (_, searches) = &study.case;
    searches
        .iter()
        .map(|s| {
            let name = format!("from {} and {}", s.start[0], s.start[1]);
            Series::line(name, numbered(s.calls.iter().map(pick)))
        })
        .collect()
}

fn fig12_kou(study: &ReportStudy) -> Chart {
    let p = &study.case.0;
    Chart::new(
        format!(
            "Secant search at {:.0} r/min, {:.1} MPa, {:.1} degC (paper fig. 12)",
            p.n_p_rpm, p.p_h_mpa, p.t_b_c
        ),
        "call of the lumped model",
        "Kou, (L/min)/MPa",
        fig12(study, |c| c.0),
    )
}

fn fig12_ratio(study: &ReportStudy) -> Chart {
    let mut all = fig12(study, |c| c.1);
    let longest = all.iter().map(|s| s.points.len()).max().unwrap_or(1) as f64;
    let ratio = study.case.0.ratio;
    all.push(Series::line("measured", [(1.0, ratio), (longest, ratio)]));
    Chart::new("Ratio in the same searches", "call of the lumped model", "speed ratio", all)
}

fn fig13(study: &ReportStudy) -> Chart {
    let errors = |result: &Identification| -> Vec<f64> { result.points.iter().map(error_of).collect() };
    let dots = |name: String, errors: Vec<f64>| Series::new(name, Marks::Dots, numbered(errors.into_iter()));
    Chart::new(
        "Error of the predicted ratio, point by point (paper fig. 13)",
        "point",
        "error of the ratio, %",
        vec![
            dots(format!("constant {:.4}", study.constant), study.constant_error_pct.clone()),
            dots("law, two steps".into(), errors(&study.paper)),
            dots("law, joint".into(), errors(&study.joint)),
        ],
    )
}

fn error_of(p: &PointResult) -> f64 {
    100.0 * (p.ratio_by_law / p.point.ratio - 1.0)
}

fn used(study: &ReportStudy) -> Vec<BenchPoint> {
    study.joint.points.iter().map(|p| p.point).collect()
}

/// Kou by the law with its standard error.
fn law(joint: &Identification, n: f64, p: f64, t: f64) -> (f64, f64) {
    let point =
        BenchPoint { line: 0, n_p_rpm: n, p_h_mpa: p, p_l_mpa: None, t_b_c: t, alpha: 1.0, ratio: 1.0 };
    let f = phi(normalised(&joint.fit.law, n, p, t));
    let of_coefficients: f64 = joint
        .fit
        .law
        .covariance_factor
        .rows()
        .into_iter()
        .map(|row| row.iter().rev().zip(f.iter().rev()).map(|(r, f)| f64::from(*r) * f).sum::<f64>().powi(2))
        .sum();
    let misfit = f64::from(joint.fit.law.residual_se.get());
    let rest = f64::from(joint.fit.law.covariance_factor.remainder.get());
    (joint.fit.kou(&point), (of_coefficients + misfit * misfit + rest * rest).sqrt())
}

/// Kou by the law along a line of the envelope, with its confidence band.
fn law_band(
    name: String,
    joint: &Identification,
    at: impl Fn(f64) -> [f64; 3],
    x: impl Fn([f64; 3]) -> f64,
) -> Series {
    let points = (0..=12).map(|i| {
        let [n, p, t] = at(f64::from(i) / 12.0);
        let (kou, se) = law(joint, n, p, t);
        DataPoint::with_error(x([n, p, t]), kou, se)
    });
    Series::new(name, Marks::Band, points)
}

/// Kou over speed at three temperatures, at two pressures: sections of the paper's surfaces that can be read from paper.
fn fig14(study: &ReportStudy) -> Vec<Chart> {
    let points = used(study);
    let [n0, n1] = extent(&points, |p| p.n_p_rpm);
    let [p0, p1] = extent(&points, |p| p.p_h_mpa);
    let [t0, t1] = extent(&points, |p| p.t_b_c);
    [0.25, 0.75]
        .into_iter()
        .map(|share| {
            let p = p0 + share * (p1 - p0);
            let band = |t: f64| {
                law_band(format!("{t:.0} degC"), &study.joint, |i| [n0 + (n1 - n0) * i, p, t], |[n, ..]| n)
            };
            let nearby = study.joint.points.iter().filter(|r| (r.point.p_h_mpa - p).abs() < 0.1 * (p1 - p0));
            let mut series: Vec<Series> = [t0, 0.5 * (t0 + t1), t1].map(band).into();
            series.push(Series::new("points", Marks::Dots, nearby.map(|r| (r.point.n_p_rpm, r.kou))));
            Chart::new(
                format!("Kou over speed and temperature at {p:.0} MPa, 95 % bands (paper fig. 14)"),
                "pump speed, r/min",
                "Kou, (L/min)/MPa",
                series,
            )
        })
        .collect()
}

fn fig16(machine: &Machine, study: &ReportStudy) -> Chart {
    let points = used(study);
    let [n0, n1] = extent(&points, |p| p.n_p_rpm);
    let [p0, p1] = extent(&points, |p| p.p_h_mpa);
    let [t0, t1] = extent(&points, |p| p.t_b_c);
    let p = 0.5 * (p0 + p1);
    let band = |n: f64| {
        let viscosity = |[.., t]: [f64; 3]| viscosity_mm2_s(machine, t);
        law_band(format!("{n:.0} r/min"), &study.joint, |i| [n, p, t0 + (t1 - t0) * i], viscosity)
    };
    Chart::new(
        format!("Kou over viscosity at {p:.0} MPa (paper fig. 16)"),
        "kinematic viscosity of the oil, mm2/s",
        "Kou, (L/min)/MPa",
        [n0, 0.5 * (n0 + n1), n1].map(band).into(),
    )
}

fn residual_ratio(study: &ReportStudy) -> Chart {
    let (inliers, outliers): (Vec<_>, Vec<_>) = study.joint.points.iter().partition(|p| !p.is_outlier());
    let dots = |name, points: Vec<&PointResult>| {
        Series::new(name, Marks::Dots, points.into_iter().map(|p| (p.point.p_h_mpa, error_of(p))))
    };
    Chart::new(
        "Residuals of the ratio",
        "high pressure, MPa",
        "ratio by law - measured, %",
        vec![dots("points", inliers), dots("outliers", outliers)],
    )
}

fn residual_kou(study: &ReportStudy) -> Chart {
    let points = study.joint.points.iter();
    let [low, high] = points.clone().fold([f64::INFINITY, 0.0_f64], |[l, h], p| [l.min(p.kou), h.max(p.kou)]);
    let dots = points.map(|p| DataPoint::with_error(p.kou, p.kou_law, p.kou_law_se));
    Chart::new(
        "Kou by the law over observed Kou, 95 % intervals",
        "observed Kou, (L/min)/MPa",
        "Kou by the law, (L/min)/MPa",
        vec![Series::new("points", Marks::Dots, dots), Series::line("equal", [(low, low), (high, high)])],
    )
}

fn leave_one_out(study: &ReportStudy) -> Chart {
    let points = study.joint.points.iter().map(|p| (error_of(p), 100.0 * p.leave_one_out));
    Chart::new(
        "Error of the ratio when the point itself is left out",
        "error with the point, %",
        "error without the point, %",
        vec![Series::new("points", Marks::Dots, points)],
    )
}
