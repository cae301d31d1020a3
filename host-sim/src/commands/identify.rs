//! `host-sim identify`: bench points and a machine file become a calibration.

use std::path::{Path, PathBuf};

use serde::Serialize;
use serde_json::{Map, Value, json};

use super::{Failure, print_json, print_text};
use crate::calibration::{self, SensorClass, Settings};
use crate::identify::{Identification, TERMS, by_reduced_model, physical};
use crate::input::InputError;
use crate::machine::Machine;
use crate::record::read_bench;
use crate::replay::reason_label;
use crate::table::Mapping;

/// Model that the identification inverts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Model {
    /// The reduced model of the controller, by its closed-form inverse.
    Rom,
}

/// Identifies a calibration from bench points.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Bench table (CSV): n_p_rpm, p_h_mpa, t_b_c, ratio and optionally alpha, p_l_mpa.
    #[arg(long, value_name = "POINTS.csv")]
    pub bench: PathBuf,
    /// Machine file (TOML).
    #[arg(long, value_name = "M.toml")]
    pub machine: PathBuf,
    /// Model to invert.
    #[arg(long, value_enum, default_value = "rom")]
    pub model: Model,
    /// Mapping file (TOML) for a table with other columns or units.
    #[arg(long, value_name = "MAP.toml")]
    pub map: Option<PathBuf>,
    /// Calibration to write: TOML, or a binary record where the name ends in .bin.
    #[arg(long, value_name = "CAL.toml")]
    pub out: PathBuf,
    /// Serial number of the machine on the bench.
    #[arg(long, default_value = "")]
    pub serial: String,
    /// Day of the bench test, as it shall stand in the calibration.
    #[arg(long, default_value = "")]
    pub date: String,
    /// ISO 4409 class of the sensors on the controller, for the standard error of the coefficient seen.
    #[arg(long, value_enum, default_value = "A")]
    pub class: SensorClass,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

/// Reads a mapping file, if one is named.
pub(super) fn mapping(path: Option<&Path>) -> Result<Mapping, InputError> {
    path.map_or_else(|| Ok(Mapping::default()), Mapping::read)
}

fn crc32_of(path: &Path) -> Result<u32, InputError> {
    let bytes =
        std::fs::read(path).map_err(|e| InputError::new(format!("cannot be read: {e}")).at_file(path))?;
    Ok(kou_estimator::calibration::record::crc32(&bytes))
}

/// Runs the command.
///
/// # Errors
/// Bad input; or points that no leakage explains.
pub fn run(args: &Args) -> Result<(), Failure> {
    let machine = Machine::load(&args.machine)?;
    let points = read_bench(&args.bench, &mapping(args.map.as_deref())?, &machine)?;
    let settings = Settings {
        serial: args.serial.clone(),
        date: args.date.clone(),
        class: args.class,
        bench_crc32: crc32_of(&args.bench)?,
        machine_crc32: crc32_of(&args.machine)?,
    };
    let Model::Rom = args.model;
    let result = by_reduced_model(&machine, &points, &settings).map_err(|e| e.at_file(&args.bench))?;
    calibration::write(&args.out, &result.calibration)?;
    if args.json { print_json(&report(&result)) } else { print_text(&summary(&result, &args.out)) }
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
    ratio_by_law: f64,
}

fn report(result: &Identification) -> Value {
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
            ratio_by_law: r.ratio_by_law,
        })
        .collect();
    let refused: Vec<Value> = result
        .refused
        .iter()
        .map(|r| {
            json!({
                "line": r.point.line,
                "ratio": r.point.ratio,
                "leak_free_ratio": r.leak_free_ratio,
                "reason": reason_label(r.reason),
            })
        })
        .collect();
    let law = &result.fit.law;
    let named = |values: [f64; 10]| {
        TERMS.into_iter().zip(values).map(|(k, v)| (k.to_string(), json!(v))).collect::<Map<_, _>>()
    };
    let k =
        [law.c, law.b1, law.b2, law.b3, law.a11, law.a22, law.a33, law.a12, law.a13, law.a23].map(f64::from);
    json!({
        "points": points,
        "refused_points": refused,
        "law": {
            "normalised": named(k),
            "physical": named(physical(law)),
            "n_max_rpm": law.n_max.get(),
            "p_max_mpa": law.p_max.get(),
            "t_max_c": law.t_max.get(),
            "residual_se": law.residual_se.get(),
        },
        "dropped_terms": result.fit.dropped,
        "ratio_error_mean_pct": result.ratio_error_mean_pct,
        "condition_number": result.fit.condition_number,
    })
}

fn summary(result: &Identification, out: &Path) -> String {
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
    for refused in &result.refused {
        text += &format!(
            "line {} not used: ratio {} is above the leak-free ratio {:.5}\n",
            refused.point.line, refused.point.ratio, refused.leak_free_ratio
        );
    }
    text + &format!("calibration written to {}", out.display())
}
