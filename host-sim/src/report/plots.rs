//! The charts of a report.

use crate::synth::viscosity_mm2_s;
use kou_identify::{Identification, evaluate, normalised, phi};
use kou_lumped::machine::Machine;
use kou_records::BenchPoint;

use super::chart::{Chart, Point, Series, Style};
use super::study::{Study, extent};

/// Every chart, in the order of the page.
pub fn all(machine: &Machine, study: &Study) -> Vec<Chart> {
    let mut charts = vec![fig8(study), fig12_kou(study), fig12_ratio(study), fig13(study)];
    charts.extend(fig14(study));
    charts.extend([fig16(machine, study), residual_ratio(study), residual_kou(study), leave_one_out(study)]);
    charts
}

fn series(name: impl Into<String>, style: Style, points: Vec<Point>) -> Series {
    Series { name: name.into(), style, points }
}

fn fig8(study: &Study) -> Chart {
    let of = |pick: fn(&(f64, f64, f64)) -> f64| study.fig8.iter().map(|p| (p.0, pick(p), None)).collect();
    Chart {
        title: format!("Ratio over pressure at {:.0} r/min (paper fig. 8)", study.fig8_rpm),
        x: "high pressure, MPa",
        y: "speed ratio",
        series: vec![
            series("without leakage", Style::Line, of(|p| p.1)),
            series("with leakage by the law", Style::Line, of(|p| p.2)),
        ],
    }
}

fn fig12(study: &Study, pick: fn(&(f64, f64)) -> f64) -> Vec<Series> {
    let (_, searches) = &study.case;
    searches
        .iter()
        .map(|s| {
            let points = s.calls.iter().enumerate().map(|(i, c)| (i as f64 + 1.0, pick(c), None)).collect();
            series(format!("from {} and {}", s.start[0], s.start[1]), Style::Line, points)
        })
        .collect()
}

fn fig12_kou(study: &Study) -> Chart {
    let p = &study.case.0;
    Chart {
        title: format!(
            "Secant search at {:.0} r/min, {:.1} MPa, {:.1} degC (paper fig. 12)",
            p.n_p_rpm, p.p_h_mpa, p.t_b_c
        ),
        x: "call of the full model",
        y: "Kou, (L/min)/MPa",
        series: fig12(study, |c| c.0),
    }
}

fn fig12_ratio(study: &Study) -> Chart {
    let mut all = fig12(study, |c| c.1);
    let longest = all.iter().map(|s| s.points.len()).max().unwrap_or(1) as f64;
    let ratio = study.case.0.ratio;
    all.push(series("measured", Style::Line, vec![(1.0, ratio, None), (longest, ratio, None)]));
    Chart {
        title: "Ratio in the same searches".into(),
        x: "call of the full model",
        y: "speed ratio",
        series: all,
    }
}

fn fig13(study: &Study) -> Chart {
    let joint = study.joint.points.iter().map(error_of).enumerate().map(|(i, e)| (i as f64 + 1.0, e, None));
    let paper = study.paper.points.iter().map(error_of).enumerate().map(|(i, e)| (i as f64 + 1.0, e, None));
    let constant = study.constant_error_pct.iter().enumerate().map(|(i, e)| (i as f64 + 1.0, *e, None));
    Chart {
        title: "Error of the predicted ratio, point by point (paper fig. 13)".into(),
        x: "point",
        y: "error of the ratio, %",
        series: vec![
            series(format!("constant {:.4}", study.constant), Style::Dots, constant.collect()),
            series("law, two steps", Style::Dots, paper.collect()),
            series("law, joint", Style::Dots, joint.collect()),
        ],
    }
}

fn error_of(p: &kou_identify::PointResult) -> f64 {
    100.0 * (p.ratio_by_law / p.point.ratio - 1.0)
}

fn used(study: &Study) -> Vec<BenchPoint> {
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
    (evaluate(&joint.fit, &point), (of_coefficients + misfit * misfit + rest * rest).sqrt())
}

/// Kou over speed at three temperatures, at two pressures: sections of the paper's surfaces, which paper can be read from.
fn fig14(study: &Study) -> Vec<Chart> {
    let points = used(study);
    let [n0, n1] = extent(&points, |p| p.n_p_rpm);
    let [p0, p1] = extent(&points, |p| p.p_h_mpa);
    let [t0, t1] = extent(&points, |p| p.t_b_c);
    [0.25, 0.75]
        .into_iter()
        .map(|share| {
            let p = p0 + share * (p1 - p0);
            let bands = [t0, 0.5 * (t0 + t1), t1].into_iter().map(|t| {
                let line = (0..=12).map(|i| {
                    let n = n0 + (n1 - n0) * f64::from(i) / 12.0;
                    let (kou, se) = law(&study.joint, n, p, t);
                    (n, kou, Some(se))
                });
                series(format!("{t:.0} degC"), Style::Band, line.collect())
            });
            let mut all: Vec<Series> = bands.collect();
            let seen = study.joint.points.iter().filter(|r| (r.point.p_h_mpa - p).abs() < 0.1 * (p1 - p0));
            all.push(series("points", Style::Dots, seen.map(|r| (r.point.n_p_rpm, r.kou, None)).collect()));
            Chart {
                title: format!("Kou over speed and temperature at {p:.0} MPa, 95 % bands (paper fig. 14)"),
                x: "pump speed, r/min",
                y: "Kou, (L/min)/MPa",
                series: all,
            }
        })
        .collect()
}

fn fig16(machine: &Machine, study: &Study) -> Chart {
    let points = used(study);
    let [n0, n1] = extent(&points, |p| p.n_p_rpm);
    let [p0, p1] = extent(&points, |p| p.p_h_mpa);
    let [t0, t1] = extent(&points, |p| p.t_b_c);
    let series = [n0, 0.5 * (n0 + n1), n1]
        .into_iter()
        .map(|n| {
            let line = (0..=12).map(|i| {
                let t = t0 + (t1 - t0) * f64::from(i) / 12.0;
                let (kou, se) = law(&study.joint, n, 0.5 * (p0 + p1), t);
                (viscosity_mm2_s(machine, t), kou, Some(se))
            });
            series(format!("{n:.0} r/min"), Style::Band, line.collect())
        })
        .collect();
    Chart {
        title: format!("Kou over viscosity at {:.0} MPa (paper fig. 16)", 0.5 * (p0 + p1)),
        x: "kinematic viscosity of the oil, mm2/s",
        y: "Kou, (L/min)/MPa",
        series,
    }
}

fn residual_ratio(study: &Study) -> Chart {
    let (good, outliers): (Vec<_>, Vec<_>) = study.joint.points.iter().partition(|p| !p.is_outlier());
    let of = |points: Vec<&kou_identify::PointResult>| {
        points.into_iter().map(|p| (p.point.p_h_mpa, error_of(p), None)).collect()
    };
    Chart {
        title: "Residuals of the ratio".into(),
        x: "high pressure, MPa",
        y: "ratio by law - measured, %",
        series: vec![series("points", Style::Dots, of(good)), series("outliers", Style::Dots, of(outliers))],
    }
}

fn residual_kou(study: &Study) -> Chart {
    let points = study.joint.points.iter().map(|p| (p.kou, p.kou_law, Some(p.kou_law_se))).collect();
    let [low, high] =
        study.joint.points.iter().fold([f64::INFINITY, 0.0_f64], |[l, h], p| [l.min(p.kou), h.max(p.kou)]);
    Chart {
        title: "Kou by the law over Kou seen, 95 % intervals".into(),
        x: "Kou seen, (L/min)/MPa",
        y: "Kou by the law, (L/min)/MPa",
        series: vec![
            series("points", Style::Dots, points),
            series("equal", Style::Line, vec![(low, low, None), (high, high, None)]),
        ],
    }
}

fn leave_one_out(study: &Study) -> Chart {
    let points = study.joint.points.iter().map(|p| (error_of(p), 100.0 * p.leave_one_out, None)).collect();
    Chart {
        title: "Error of the ratio when the point itself is left out".into(),
        x: "error with the point, %",
        y: "error without the point, %",
        series: vec![series("points", Style::Dots, points)],
    }
}
