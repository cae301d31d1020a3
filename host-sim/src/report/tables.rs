//! The tables of a report.

use std::fmt::Write;

use kou_identify::{Identification, TERMS, coefficients, physical};

use super::chart::escape;
use super::study::Study;

fn table(heading: &[&str], rows: impl IntoIterator<Item = Vec<String>>) -> String {
    let mut text = String::from("<table><thead><tr>");
    for h in heading {
        // Writing to a String cannot fail; `ok` says that this is known.
        write!(text, "<th>{}</th>", escape(h)).ok();
    }
    text += "</tr></thead><tbody>";
    for row in rows {
        text += "<tr>";
        for cell in row {
            write!(text, "<td>{}</td>", escape(&cell)).ok();
        }
        text += "</tr>";
    }
    text + "</tbody></table>\n"
}

fn mean_loo_pct(result: &Identification) -> f64 {
    100.0 * result.points.iter().map(|p| p.leave_one_out.abs()).sum::<f64>() / result.points.len() as f64
}

/// What stands before the charts: provenance, comparison, unknowns.
pub fn head(study: &Study) -> String {
    let joint = &study.joint;
    let about = &joint.calibration.provenance;
    let mut text = format!(
        "<p class=\"note\">{} of {} points used. Serial number {}, date {}. Bench table CRC-32 {:08x}, machine file {:08x}, {}.</p>\n",
        joint.points.len(),
        joint.points.len() + joint.refused.len(),
        or_dash(&joint.calibration.machine.serial),
        or_dash(&about.date),
        about.bench_crc32,
        about.machine_crc32,
        escape(&about.tool)
    );
    let constant = study.constant_error_pct.iter().filter(|e| e.is_finite()).map(|e| e.abs());
    let constant_mean = constant.clone().sum::<f64>() / constant.count().max(1) as f64;
    text += "<h2>How well the ratio is predicted</h2>\n";
    text += &table(
        &["Kou as", "mean error of the ratio, %", "the same, point left out, %"],
        [
            vec![format!("constant {:.4}", study.constant), format!("{constant_mean:.3}"), String::new()],
            vec![
                "law, two steps (paper)".into(),
                format!("{:.3}", study.paper.ratio_error_mean_pct),
                String::new(),
            ],
            vec![
                "law, joint".into(),
                format!("{:.3}", joint.ratio_error_mean_pct),
                format!("{:.3}", mean_loo_pct(joint)),
            ],
        ],
    );
    text += "<h2>What was found besides the law</h2>\n";
    text += &table(
        &["quantity", "change from the file, %", "standard error, %", "known before to, %", "determined by"],
        joint.unknowns.iter().filter(|u| u.prior_se.is_some()).map(|u| {
            vec![
                u.name.clone(),
                format!("{:+.3}", 100.0 * u.value),
                format!("{:.3}", 100.0 * u.se),
                format!("{:.1}", 100.0 * u.prior_se.unwrap_or(0.0)),
                if u.by_data() { "the points".into() } else { "what was known before".into() },
            ]
        }),
    );
    if let Some(s) = &joint.surrogate {
        writeln!(
            text,
            "<p class=\"note\">The controller's reduced model was fitted to the full model at {} points: error of the ratio \
             {:.1e} on average, {:.1e} at worst.</p>",
            s.points, s.ratio_error_mean, s.ratio_error_max
        )
        .ok();
    }
    text
}

/// What stands behind the charts: law, points left out, outliers, region, advice.
pub fn tail(study: &Study) -> String {
    let joint = &study.joint;
    let law = &joint.fit.law;
    let mut text = format!(
        "<h2>The law</h2>\n<p class=\"note\">Normalisers {} r/min, {} MPa, {} degC; misfit {:.5} (L/min)/MPa; condition number {:.0}; \
         squared residuals per degree of freedom {:.2}. Terms that the points do not determine: {}.</p>\n",
        law.n_max.get(),
        law.p_max.get(),
        law.t_max.get(),
        law.residual_se.get(),
        joint.fit.condition_number,
        joint.chi2_per_freedom,
        or_dash(&joint.fit.dropped.join(", "))
    );
    let se = |term: &str| {
        joint.unknowns.iter().find(|u| u.name == term).map_or(String::new(), |u| format!("{:.5}", u.se))
    };
    text += &table(
        &["term", "normalised, (L/min)/MPa", "standard error", "physical"],
        TERMS.into_iter().zip(coefficients(law)).zip(physical(law)).map(|((term, k), physical)| {
            vec![term.into(), format!("{k:+.5}"), se(term), format!("{physical:+.4e}")]
        }),
    );
    text += "<h2>Points to look at</h2>\n";
    let mut rows: Vec<Vec<String>> = joint
        .refused
        .iter()
        .map(|r| {
            let free = r.leak_free_ratio.map_or(String::new(), |f| format!("leak-free ratio {f:.5}"));
            vec![
                r.point.line.to_string(),
                format!("{:.5}", r.point.ratio),
                format!("not used: {}", r.reason),
                free,
            ]
        })
        .collect();
    rows.extend(joint.points.iter().filter(|p| p.is_outlier()).map(|p| {
        vec![
            p.point.line.to_string(),
            format!("{:.5}", p.point.ratio),
            format!("outlier, weight {:.2}", p.weight),
            format!("ratio by the law {:.5}", p.ratio_by_law),
        ]
    }));
    text += &if rows.is_empty() {
        "<p class=\"note\">None.</p>\n".into()
    } else {
        table(&["line", "ratio", "why", ""], rows)
    };
    text += "<h2>Region in which the law holds</h2>\n";
    let (n, p, t) = (law.n_max.get(), law.p_max.get(), law.t_max.get());
    let region = &joint.fit.region;
    let span = |bound: &kou_estimator::model::calibrated_region::Bound, scale: f32, unit: &str| {
        format!("{:.0} to {:.0} {unit}", bound.min * scale, bound.max * scale)
    };
    writeln!(
        text,
        "<p class=\"note\">{}, {}, {}, cut by the planes at 45 degrees that touch the points.</p>",
        span(&region.speed, n, "r/min"),
        span(&region.pressure, p, "MPa"),
        span(&region.temperature, t, "degC")
    )
    .ok();
    text += "<h2>What to measure next</h2>\n";
    text += &table(
        &[
            "points (r/min, MPa, degC, displacement)",
            "standard error of Kou now, %",
            "then, %",
            "of the bulk modulus then, %",
        ],
        study.advice.iter().map(|a| {
            let points: Vec<String> =
                a.points.iter().map(|[n, p, t, alpha]| format!("{n:.0}, {p:.0}, {t:.0}, {alpha}")).collect();
            vec![
                points.join("; "),
                format!("{:.1}", a.kou_se_now_pct),
                format!("{:.1}", a.kou_se_then_pct),
                format!("{:.1}", a.bulk_se_then_pct),
            ]
        }),
    );
    text
}

fn or_dash(text: &str) -> String {
    if text.is_empty() { "-".into() } else { escape(text) }
}
