//! `host-sim report`: the HTML report of a calibration, for the calibration engineer to sign.

use std::path::PathBuf;

use super::bench_args::{BenchArgs, BenchInputs};
use super::failure::Failure;
use super::output::print_text;
use crate::output_file::write_file;
use crate::report::{self, ReportStudy};
use kou_identify::LumpedPlant;

/// Writes a report on a calibration: one HTML file with plots, for mail and paper.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    given: BenchArgs,
    /// Report to write.
    #[arg(long, value_name = "REPORT.html")]
    pub out: PathBuf,
}

/// Runs the command.
///
/// # Errors
/// Bad input, or a report that cannot be written.
pub fn run(args: &Args) -> Result<(), Failure> {
    let BenchInputs { machine, points, settings, prior, .. } = args.given.read()?;
    let full = LumpedPlant::new(&machine).map_err(|e| e.at_file(&args.given.machine))?;
    let study = ReportStudy::new(&machine, &points, &settings, &full, &prior)
        .map_err(|e| e.at_file(&args.given.bench))?;
    write_file(&args.out, report::html(&machine, &study)?)?;
    print_text(&format!("report written to {}", args.out.display()))
}
