//! `host-sim identify`: a calibration from bench points and a machine file.

use std::path::{Path, PathBuf};

use serde::Serialize;
use serde_json::{Map, Value, json};

use super::bench_args::{BenchArgs, BenchInputs, positive};
use super::failure::Failure;
use super::output::{print_json, print_text};
use kou_identify::calibration::CalibrationSettings;
use kou_identify::secant::SecantSettings;
use kou_identify::{
    Identification, LumpedPlant, OperatingPoint, PlantModel, ReducedPlant, RejectedPoint, SolutionCache,
    TERMS, coefficients, experiment_design, joint_scheme, operating_point, physical, two_step,
};
use kou_lumped::machine::Machine;
use kou_records::{InputError, calibration};

/// Model that the identification inverts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum InvertedModel {
    /// The reduced model of the controller, by its closed-form inverse.
    Rom,
    /// The lumped model; needs a machine file with valve plates and circuit.
    Full,
}

/// Identification scheme: from points to a law.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Scheme {
    /// Law, displacement ratio, bulk modulus and displacement settings fitted together in the ratio domain.
    Joint,
    /// The paper's two steps: Kou of every point by itself, then the law through them.
    Paper,
}

/// Identifies a calibration from bench points.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    given: BenchArgs,
    /// Model to invert; by default the lumped one where the machine file has what it needs, otherwise the reduced one.
    #[arg(long, value_enum)]
    pub model: Option<InvertedModel>,
    /// Scheme.
    #[arg(long, value_enum, default_value = "joint")]
    pub scheme: Scheme,
    /// Paper's scheme: stopping rule of the secant, relative error of the ratio (the paper's own: 0.005).
    #[arg(long, default_value_t = 1e-4, value_parser = positive)]
    pub tolerance: f64,
    /// Paper's scheme: start interval of the secant, two coefficients; by default from the reduced model.
    #[arg(long, num_args = 2, value_names = ["KOU", "KOU"], value_parser = positive)]
    pub start: Vec<f64>,
    /// Paper's scheme: most calls of the lumped model for one point.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(2..))]
    pub max_calls: u32,
    /// Calibration to write: TOML, or a binary record where the name ends in .bin.
    #[arg(long, value_name = "CAL.toml")]
    pub out: PathBuf,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

/// Runs the command.
///
/// # Errors
/// Bad input, or points that no leakage explains.
pub fn run(args: &Args) -> Result<(), Failure> {
    let BenchInputs { machine, points, repeated, settings, prior } = args.given.read()?;
    let start = match args.start.as_slice() {
        [a, b] => Some([*a, *b]),
        _ => None,
    };
    let secant = SecantSettings { tolerance: args.tolerance, start, max_calls: args.max_calls };
    let identify = |model: Option<&dyn PlantModel>| {
        match args.scheme {
            Scheme::Joint => joint_scheme::identify(&machine, &points, &settings, model, &prior),
            Scheme::Paper => two_step::identify(&machine, &points, &settings, model, &secant),
        }
        .map_err(|e| e.at_file(&args.given.bench))
    };
    let (model, full) = model_of(args, &machine)?;
    let mut result = match &full {
        None => identify(None)?,
        Some(full) => with_full_model(args, full, &settings, points.len(), identify)?,
    };
    // Rows equal to the last digit are a copied row, not a repeated measurement.
    result.rejected.extend(repeated.into_iter().map(|(point, line)| RejectedPoint {
        point,
        reason: format!("repeats line {line}"),
        leak_free_ratio: None,
    }));
    calibration::write(&args.out, &result.calibration)?;
    let advice = match &result.solution {
        Some(solution) => {
            let measured: Vec<OperatingPoint> =
                result.points.iter().map(|p| operating_point(&p.point)).collect();
            experiment_design::propose(
                &measured,
                &result.fit,
                &ReducedPlant::new(&machine)?,
                solution,
                &prior,
            )?
        }
        None => Vec::new(),
    };
    if args.json {
        let mut report = report(&result, &advice);
        report["model"] = json!(if full.is_some() { "full" } else { "rom" });
        print_json(&report)
    } else {
        print_text(&format!("{model}{}", summary(&result, &advice, &args.out)))
    }
}

/// The lumped model, where it is chosen, and the announcement of the choice.
fn model_of(args: &Args, machine: &Machine) -> Result<(String, Option<LumpedPlant>), InputError> {
    match (args.model, LumpedPlant::new(machine)) {
        (Some(InvertedModel::Rom), _) => Ok(("model: reduced model, as chosen\n".into(), None)),
        (_, Ok(full)) => {
            let model = "model: lumped model; the valve plates and the circuit of the machine file are taken as given\n";
            Ok((model.into(), Some(full)))
        }
        (Some(InvertedModel::Full), Err(e)) => Err(e.at_file(&args.given.machine)),
        (None, Err(e)) => {
            Ok((format!("model: reduced model, since the machine file lacks the lumped one: {e}\n"), None))
        }
    }
}

/// Identifies with the lumped model; its solutions are cached in a file next to the calibration until that is written.
fn with_full_model(
    args: &Args,
    full: &LumpedPlant,
    settings: &CalibrationSettings,
    points: usize,
    identify: impl Fn(Option<&dyn PlantModel>) -> Result<Identification, InputError>,
) -> Result<Identification, Failure> {
    let partial = args.out.with_extension("partial");
    // Joint: two to three iterations and the surrogate; paper: three to four calls for each point.
    let expected = match args.scheme {
        Scheme::Joint => 3 * points + 96,
        Scheme::Paper => 4 * points,
    };
    let bar = progress_of(expected);
    let ticking = bar.clone();
    let tick = move || {
        if ticking.position() >= ticking.length().unwrap_or(0) {
            ticking.inc_length(points as u64);
        }
        ticking.inc(1);
    };
    let cache = SolutionCache::new(settings.machine_crc32, Some(&partial), tick)?;
    let result = identify(Some(&cache.over(full)))?;
    bar.finish_and_clear();
    // A cache that cannot be removed does no harm.
    drop(std::fs::remove_file(&partial));
    Ok(result)
}

fn progress_of(expected: usize) -> indicatif::ProgressBar {
    let style = indicatif::ProgressStyle::with_template("{bar:30} {pos}/{len} steady points, {eta} left")
        .unwrap_or_else(|_| indicatif::ProgressStyle::default_bar());
    indicatif::ProgressBar::new(expected as u64).with_style(style)
}

#[derive(Serialize)]
struct PointReport {
    line: u64,
    n_p_rpm: f64,
    p_h_mpa: f64,
    t_b_c: f64,
    alpha: f64,
    ratio: f64,
    kou: f64,
    kou_law: f64,
    kou_law_se: f64,
    ratio_by_law: f64,
    leave_one_out: f64,
    weight: f64,
    outlier: bool,
    calls: u32,
}

fn report(result: &Identification, advice: &[experiment_design::Proposal]) -> Value {
    let points: Vec<PointReport> = result
        .points
        .iter()
        .map(|r| PointReport {
            line: r.point.line,
            n_p_rpm: r.point.n_p_rpm,
            p_h_mpa: r.point.p_h_mpa,
            t_b_c: r.point.t_b_c,
            alpha: r.point.alpha,
            ratio: r.point.ratio,
            kou: r.kou,
            kou_law: r.kou_law,
            kou_law_se: r.kou_law_se,
            ratio_by_law: r.ratio_by_law,
            leave_one_out: r.leave_one_out,
            weight: r.weight,
            outlier: r.is_outlier(),
            calls: r.calls,
        })
        .collect();
    let rejected: Vec<Value> = result
        .rejected
        .iter()
        .map(|r| {
            json!({
                "line": r.point.line,
                "ratio": r.point.ratio,
                "leak_free_ratio": r.leak_free_ratio,
                "reason": r.reason,
            })
        })
        .collect();
    let law = &result.fit.law;
    let named = |values: [f64; 10]| {
        TERMS.into_iter().zip(values).map(|(k, v)| (k.to_string(), json!(v))).collect::<Map<_, _>>()
    };
    let unknowns: Vec<Value> = result
        .parameters
        .iter()
        .map(|u| {
            json!({
                "name": u.name, "value": u.value, "se": u.se, "prior_se": u.prior_se,
                "determined_by": if u.by_data() { "data" } else { "prior" },
            })
        })
        .collect();
    let surrogate = result.surrogate.as_ref().map(|s| {
        json!({
            "points": s.points, "ratio_error_mean": s.ratio_error_mean, "ratio_error_max": s.ratio_error_max,
        })
    });
    let advice: Vec<Value> = advice
        .iter()
        .map(|p| {
            json!({
                "points": p.points, "kou_se_now_pct": p.kou_se_now_pct, "kou_se_then_pct": p.kou_se_then_pct,
                "bulk_modulus_se_then_pct": p.bulk_se_then_pct,
            })
        })
        .collect();
    json!({
        "points": points,
        "refused_points": rejected,
        "law": {
            "normalised": named(coefficients(law)),
            "physical": named(physical(law)),
            "n_max_rpm": law.n_max.get(),
            "p_max_mpa": law.p_max.get(),
            "t_max_c": law.t_max.get(),
            "residual_se": law.residual_se.get(),
        },
        "dropped_terms": result.fit.dropped,
        "ratio_error_mean_pct": result.ratio_error_mean_pct,
        "condition_number": result.fit.condition_number,
        "unknowns": unknowns,
        "correlation": result.correlation,
        "chi2_per_freedom": result.chi2_per_freedom,
        "displacement_factor": result.correction.displacement,
        "bulk_modulus_factor": result.correction.bulk,
        "surrogate": surrogate,
        "model_calls": result.model_calls,
        "advice": advice,
    })
}

fn summary(result: &Identification, advice: &[experiment_design::Proposal], out: &Path) -> String {
    let mut text = format!(
        "{} points used, mean error of the ratio {:.3} %, residual of Kou {:.5} (L/min)/MPa, condition number {:.1}\n",
        result.points.len(),
        result.ratio_error_mean_pct,
        result.fit.law.residual_se.get(),
        result.fit.condition_number
    );
    if !result.fit.dropped.is_empty() {
        text += &format!("not determined by the data, left at zero: {}\n", result.fit.dropped.join(", "));
    }
    for unknown in result.parameters.iter().filter(|u| u.prior_se.is_some()) {
        text += &format!(
            "{}: {:+.2} % +- {:.2} %, determined by {}\n",
            unknown.name,
            100.0 * unknown.value,
            100.0 * unknown.se,
            if unknown.by_data() { "the points" } else { "the prior" }
        );
    }
    if let Some(s) = &result.surrogate {
        text += &format!(
            "reduced model fitted to the lumped one: error of the ratio {:.1e} mean, {:.1e} worst over {} points\n",
            s.ratio_error_mean, s.ratio_error_max, s.points
        );
    }
    for point in result.points.iter().filter(|p| p.is_outlier()) {
        text += &format!("line {}: outlier, weight {:.2}\n", point.point.line, point.weight);
    }
    for rejected in &result.rejected {
        let line = rejected.point.line;
        text += &match rejected.leak_free_ratio {
            Some(leak_free) => format!(
                "line {line} not used: ratio {} is above the leak-free ratio {leak_free:.5}\n",
                rejected.point.ratio
            ),
            None => format!("line {line} not used: {}\n", rejected.reason),
        };
    }
    if let Some(best) = advice.first() {
        text += &format!(
            "next points to measure, for a standard error of Kou of {:.1} instead of {:.1} %:\n",
            best.kou_se_then_pct, best.kou_se_now_pct
        );
        for [n, p, t, alpha] in &best.points {
            text += &format!("    {n:.0} r/min, {p:.0} MPa, {t:.0} degC, displacement {alpha}\n");
        }
    }
    text + &format!("calibration written to {}", out.display())
}
