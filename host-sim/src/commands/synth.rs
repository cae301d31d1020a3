//! `host-sim synth`: synthetic bench tables and drive logs, which say that they are synthetic.

use std::io::Write;
use std::path::{Path, PathBuf};

use super::Failure;
use super::identify::Model;
use crate::synth::{BENCH, DRIVE, Instruments, write_bench, write_drive};
use kou_identify::calibration::SensorClass;
use kou_identify::ratio_model::{FullRatio, RatioModel, ReducedRatio};
use kou_lumped::machine::Machine;
use kou_records::InputError;

/// Makes synthetic records from the full model and a leakage truth that is not quadratic.
#[derive(Debug, clap::Args)]
#[command(group = clap::ArgGroup::new("what").required(true).multiple(true).args(["out", "drive"]))]
pub struct Args {
    /// Machine file (TOML).
    #[arg(long, value_name = "M.toml")]
    pub machine: PathBuf,
    /// ISO 4409 class within which every instrument has a systematic error; without it there are random errors only.
    #[arg(long, value_enum)]
    pub class: Option<SensorClass>,
    /// No errors at all, and every set point met.
    #[arg(long, conflicts_with = "class")]
    pub exact: bool,
    /// Twelve more bench points at partial displacement.
    #[arg(long)]
    pub partial: bool,
    /// Model that gives the true speed ratio.
    #[arg(long, value_enum, default_value = "full")]
    pub model: Model,
    /// Seed of the errors.
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
    let model: Box<dyn RatioModel> = match args.model {
        Model::Full => Box::new(FullRatio::new(&machine).map_err(|e| e.at_file(&args.machine))?),
        Model::Rom => Box::new(ReducedRatio::new(&machine).map_err(|e| e.at_file(&args.machine))?),
    };
    let class = match args.class {
        Some(SensorClass::A) => ", class A",
        Some(SensorClass::B) => ", class B",
        Some(SensorClass::C) => ", class C",
        None => "",
    };
    let name = match args.model {
        Model::Full => "full model",
        Model::Rom => "reduced model",
    };
    let origin = format!("{name}{class}, seed {}", args.seed);
    if let Some(path) = &args.out {
        let instruments = (!args.exact).then(|| Instruments::new(args.seed, args.class, BENCH));
        write(path, |bytes| {
            write_bench(bytes, &machine, model.as_ref(), instruments, args.partial, &origin)
        })?;
    }
    if let Some(path) = &args.drive {
        let mut instruments = Instruments::new(args.seed, args.class, DRIVE);
        write(path, |bytes| write_drive(bytes, &machine, model.as_ref(), &mut instruments, &origin))?;
    }
    Ok(())
}

fn write(path: &Path, make: impl FnOnce(&mut Vec<u8>) -> Result<(), InputError>) -> Result<(), InputError> {
    let mut bytes = Vec::new();
    make(&mut bytes)?;
    std::fs::File::create(path)
        .and_then(|mut file| file.write_all(&bytes))
        .map_err(|e| InputError::new(format!("cannot be written: {e}")).at_file(path))
}
