//! `host-sim synth`: synthetic bench tables and drive logs, which say that they are synthetic.

use std::io::Write;
use std::path::{Path, PathBuf};

use kou_estimator::reduced::ReducedModel;

use super::Failure;
use crate::calibration::{oil_config, reduced_config};
use crate::input::InputError;
use crate::machine::Machine;
use crate::synth::{write_bench, write_drive};

/// Makes synthetic records from the reduced model and a leakage truth that is not quadratic.
#[derive(Debug, clap::Args)]
#[command(group = clap::ArgGroup::new("what").required(true).multiple(true).args(["out", "drive"]))]
pub struct Args {
    /// Machine file (TOML).
    #[arg(long, value_name = "M.toml")]
    pub machine: PathBuf,
    /// Seed of the random errors.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Bench table to write (CSV).
    #[arg(long, value_name = "BENCH.csv")]
    pub out: Option<PathBuf>,
    /// Drive log to write (CSV).
    #[arg(long, value_name = "DRIVE.csv")]
    pub drive: Option<PathBuf>,
}

/// Runs the command.
///
/// # Errors
/// Bad input, or an output that cannot be written.
pub fn run(args: &Args) -> Result<(), Failure> {
    let machine = Machine::load(&args.machine)?;
    let model = ReducedModel::new(&reduced_config(&machine), &oil_config(&machine))
        .map_err(|e| InputError::new(e.to_string()).at_file(&args.machine))?;
    if let Some(path) = &args.out {
        write(path, |bytes| write_bench(bytes, &machine, &model, args.seed))?;
    }
    if let Some(path) = &args.drive {
        write(path, |bytes| write_drive(bytes, &machine, &model, args.seed))?;
    }
    Ok(())
}

fn write(path: &Path, make: impl FnOnce(&mut Vec<u8>) -> std::io::Result<()>) -> Result<(), InputError> {
    let mut bytes = Vec::new();
    make(&mut bytes)
        .and_then(|()| std::fs::File::create(path)?.write_all(&bytes))
        .map_err(|e| InputError::new(format!("cannot be written: {e}")).at_file(path))
}
