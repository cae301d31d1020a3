//! `host-sim update`: the frames of a calibration update over CAN, with their authentication tag.

use std::path::PathBuf;

use super::{Failure, print_text};
use crate::update::{Addresses, candump, frames, read_key};
use kou_identify::calibration;
use kou_records::InputError;

/// Writes the CAN frames that bring a calibration into a controller, as a log in candump's format.
///
/// The controller answers every frame; a player that does not wait needs a spacing that leaves it time for that.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Calibration: TOML or binary record.
    #[arg(long, value_name = "CAL.toml")]
    pub calibration: PathBuf,
    /// The controller's key: 32 bytes, or 64 hexadecimal digits.
    #[arg(long, value_name = "KEY")]
    pub key_file: PathBuf,
    /// Counter of the update; must be above that of the last accepted one.
    #[arg(long)]
    pub counter: u32,
    /// Source address that the controller has claimed.
    #[arg(long, default_value_t = 0x27)]
    pub controller: u8,
    /// Source address of the tool.
    #[arg(long, default_value_t = 0xF9)]
    pub tool: u8,
    /// Time between two frames in the log, ms.
    #[arg(long, default_value_t = 20)]
    pub spacing_ms: u32,
    /// Log to write; standard output when left out.
    #[arg(long, value_name = "FRAMES.log")]
    pub out: Option<PathBuf>,
}

/// Runs the command.
///
/// # Errors
/// A calibration that the controller would refuse, a key that is none, a file that cannot be written.
pub fn run(args: &Args) -> Result<(), Failure> {
    let (calibration, _) = calibration::read_checked(&args.calibration)?;
    let key = read_key(&args.key_file)?;
    if args.counter == 0 {
        return Err(InputError::new("--counter 0 is below every counter; begin with 1").into());
    }
    let addresses = Addresses { controller: args.controller, tool: args.tool };
    let log = candump(&frames(&calibration, args.counter, &key, addresses)?, args.spacing_ms);
    match &args.out {
        Some(path) => {
            std::fs::write(path, log).map_err(|e| InputError::new(format!("{}: {e}", path.display())).into())
        }
        None => print_text(log.trim_end()),
    }
}
