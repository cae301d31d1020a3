//! `host-sim provision`: the page that production writes into a controller with the probe.

use std::path::PathBuf;

use kou_app::update::provision;
use kou_estimator::calibration::record;

use super::Failure;
use crate::calibration;
use crate::input::InputError;
use crate::update::read_key_bytes;

/// Writes the image of the provisioning page: the controller's key, and a calibration to begin with.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Calibration to begin with (TOML or binary record): the type's, with an empty serial number, or the machine's own.
    #[arg(long, value_name = "CAL.toml", required_unless_present = "key_file")]
    pub calibration: Option<PathBuf>,
    /// The controller's key: 32 bytes, or 64 hexadecimal digits. Without it the controller takes no update.
    #[arg(long, value_name = "KEY")]
    pub key_file: Option<PathBuf>,
    /// Image to write.
    #[arg(long, value_name = "PAGE.bin")]
    pub out: PathBuf,
}

/// Runs the command.
///
/// # Errors
/// A calibration that the controller would refuse, a key that is none, a file that cannot be written.
pub fn run(args: &Args) -> Result<(), Failure> {
    let key = args.key_file.as_deref().map(read_key_bytes).transpose()?;
    let mut buffer = [0; record::MAX_LEN];
    let record = match &args.calibration {
        Some(path) => {
            let (calibration, _) = calibration::read_checked(path)?;
            let length =
                record::encode(&calibration, &mut buffer).map_err(|e| InputError::new(e.to_string()))?;
            buffer.get(..length)
        }
        None => None,
    };
    let page = provision::page(key.as_ref(), record)
        .ok_or_else(|| InputError::new("the calibration does not fit the page"))?;
    std::fs::write(&args.out, page)
        .map_err(|e| InputError::new(format!("{}: {e}", args.out.display())).into())
}
