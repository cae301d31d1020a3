//! `host-sim report`: the page that a calibration engineer signs.

use std::path::PathBuf;

use super::identify::{crc32_of, mapping};
use super::{Failure, print_text};
use crate::calibration::{SensorClass, Settings};
use crate::identify::joint::Prior;
use crate::identify::ratio_model::FullRatio;
use crate::input::InputError;
use crate::machine::Machine;
use crate::record::{read_bench, without_repeats};
use crate::report::{self, Study};

/// Writes a report on bench points: one HTML file with plots, for mail and paper.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Bench table (CSV), as for `identify`.
    #[arg(long, value_name = "POINTS.csv")]
    pub bench: PathBuf,
    /// Machine file (TOML) with all that the full model needs.
    #[arg(long, value_name = "M.toml")]
    pub machine: PathBuf,
    /// Mapping file (TOML) for a table with other columns or units.
    #[arg(long, value_name = "MAP.toml")]
    pub map: Option<PathBuf>,
    /// Page to write.
    #[arg(long, value_name = "REPORT.html")]
    pub out: PathBuf,
    /// Serial number of the machine on the bench.
    #[arg(long, default_value = "")]
    pub serial: String,
    /// Day of the bench test.
    #[arg(long, default_value = "")]
    pub date: String,
}

/// Runs the command.
///
/// # Errors
/// Bad input, or a page that cannot be written.
pub fn run(args: &Args) -> Result<(), Failure> {
    let machine = Machine::load(&args.machine)?;
    let points = read_bench(&args.bench, &mapping(args.map.as_deref())?, &machine)?;
    let (points, _) = without_repeats(points);
    let settings = Settings {
        serial: args.serial.clone(),
        date: args.date.clone(),
        class: SensorClass::A,
        bench_crc32: crc32_of(&args.bench)?,
        machine_crc32: crc32_of(&args.machine)?,
    };
    let full = FullRatio::new(&machine).map_err(|e| e.at_file(&args.machine))?;
    let study = Study::new(&machine, &points, &settings, &full, &Prior::default())
        .map_err(|e| e.at_file(&args.bench))?;
    std::fs::write(&args.out, report::html(&machine, &study))
        .map_err(|e| InputError::new(format!("cannot be written: {e}")).at_file(&args.out))?;
    print_text(&format!("report written to {}", args.out.display()))
}
