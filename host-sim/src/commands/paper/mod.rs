//! `host-sim paper`: the paper's model figures for a machine, and published against computed values.
//!
//! Figures 3 (port areas), 4 (bulk modulus), 5 (ripple), 7 (step response) and 8 (ratio over pressure), each as CSV and
//! SVG. The published values are of the paper's machine (Wang et al., docs/references.md); with another machine the table
//! shows how it differs, and the command ends with exit code 1.

mod comparison;
mod conditions;
mod figures;

use std::path::PathBuf;

use kou_lumped::LumpedModel;
use kou_lumped::machine::Machine;
use serde::Serialize;

use super::failure::Failure;
use super::output::{print_json, print_text, progress};
use crate::output_file::create_folder;
use crate::plots::svg_file;
use comparison::{ComparedValue, compare, text, write_csv};
use conditions::{KOU_STEP, ratio_rows, step_response};

/// Draws the paper's model figures and compares published with computed values.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Machine file (TOML).
    #[arg(long, value_name = "MACHINE.toml")]
    pub machine: PathBuf,
    /// Folder for the figures; it is created.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

#[derive(Serialize)]
struct PaperReport {
    values: Vec<ComparedValue>,
    figures: Vec<String>,
    within: bool,
}

/// Runs the command.
///
/// # Errors
/// Bad input, a file that cannot be written, or a computed value outside the published one's tolerance.
pub fn run(args: &Args) -> Result<(), Failure> {
    let model = LumpedModel::new(&Machine::load(&args.machine)?)?;
    create_folder(&args.out)?;
    let bar = progress("paper");
    let (free, leaking) = (step_response(&model, 0.0)?, step_response(&model, KOU_STEP)?);
    bar.inc(2);
    let rows = ratio_rows(&model)?;
    bar.inc(1);
    let drawn = [
        figures::port_areas(&model)?,
        figures::bulk_modulus(&model)?,
        figures::ripple(&model)?,
        figures::step_response(&free, &leaking),
        figures::ratio_over_pressure(&rows),
    ];
    bar.inc(1);
    let mut names = Vec::new();
    for figure in &drawn {
        let [csv, svg] = ["csv", "svg"].map(|extension| format!("{}.{extension}", figure.name));
        figure.chart.write_csv(&args.out.join(&csv), figure.columns)?;
        svg_file::draw_single(&args.out.join(&svg), &figure.chart)?;
        names.extend([csv, svg]);
    }
    bar.finish_and_clear();
    let values = compare(&free, &leaking, &rows);
    write_csv(&args.out.join("published_and_computed.csv"), &values)?;
    let within = values.iter().all(ComparedValue::is_within);
    if args.json {
        print_json(&PaperReport { values, figures: names, within })?;
    } else {
        print_text(&text(&values, &free, &leaking, &rows))?;
    }
    if within {
        Ok(())
    } else {
        Err(Failure::Check(
            "computed values differ from the published ones by more than their tolerance".into(),
        ))
    }
}
