//! `host-sim report`: the page that a calibration engineer signs.

use std::path::PathBuf;

use super::given::{Given, Read};
use super::{Failure, print_text};
use crate::report::{self, Study};
use kou_identify::ratio_model::FullRatio;
use kou_records::InputError;

/// Writes a report on bench points: one HTML file with plots, for mail and paper.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    given: Given,
    /// Page to write.
    #[arg(long, value_name = "REPORT.html")]
    pub out: PathBuf,
}

/// Runs the command.
///
/// # Errors
/// Bad input, or a page that cannot be written.
pub fn run(args: &Args) -> Result<(), Failure> {
    let Read { machine, points, settings, prior, .. } = args.given.read()?;
    let full = FullRatio::new(&machine).map_err(|e| e.at_file(&args.given.machine))?;
    let study =
        Study::new(&machine, &points, &settings, &full, &prior).map_err(|e| e.at_file(&args.given.bench))?;
    std::fs::write(&args.out, report::html(&machine, &study))
        .map_err(|e| InputError::new(format!("cannot be written: {e}")).at_file(&args.out))?;
    print_text(&format!("report written to {}", args.out.display()))
}
