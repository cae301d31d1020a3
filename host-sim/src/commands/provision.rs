//! `host-sim provision`: the page that production writes into a controller with the probe.

use std::fs::{File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use kou_app::update::provision;
use kou_emulation::provisioning;
use kou_estimator::record;

use super::Failure;
use crate::update::read_key_bytes;
use kou_identify::calibration;
use kou_records::InputError;

/// Writes the image of the provisioning page: the controller's key, and a calibration to begin with.
///
/// At least one of the two. The image holds the key: on Unix only its owner can read it.
#[derive(Debug, clap::Args)]
#[command(group = clap::ArgGroup::new("content").required(true).multiple(true))]
pub struct Args {
    /// Calibration to begin with (TOML or binary record): the type's, with an empty serial number, or the machine's own.
    #[arg(long, value_name = "CAL.toml", group = "content")]
    pub calibration: Option<PathBuf>,
    /// The controller's key: 32 bytes, or 64 hexadecimal digits. Without it the controller takes no update.
    #[arg(long, value_name = "KEY", group = "content")]
    pub key_file: Option<PathBuf>,
    /// Image to write; a file of that name is written over.
    #[arg(long, value_name = "PAGE.bin")]
    pub out: PathBuf,
}

/// Runs the command.
///
/// # Errors
/// A calibration that the controller would refuse, a key that is none, a file that cannot be written.
pub fn run(args: &Args) -> Result<(), Failure> {
    let inputs = [&args.calibration, &args.key_file];
    if inputs.into_iter().flatten().any(|input| is_same_file(input, &args.out)) {
        return Err(InputError::new("is one of the inputs and would be lost").at_file(&args.out).into());
    }
    let key = args.key_file.as_deref().map(read_key_bytes).transpose()?;
    let mut buffer = [0; record::calibration::MAX_LEN];
    let record = match &args.calibration {
        Some(path) => {
            let (calibration, _) = calibration::read_checked(path)?;
            let length = record::calibration::encode(&calibration, &mut buffer)
                .map_err(|e| InputError::new(e.to_string()))?;
            buffer.get(..length)
        }
        None => None,
    };
    let page = provisioning::page(key.as_ref(), record)
        .ok_or_else(|| InputError::new("the calibration does not fit the page"))?;
    // By the controller's own reader: what it would take for an erased place must not leave production as a key.
    if let (Some(path), None) = (&args.key_file, provision::key(&page)) {
        return Err(InputError::new("all ones or all zeros: the controller reads that as no key")
            .at_file(path)
            .into());
    }
    write_private(&args.out, &page)
        .map_err(|e| InputError::new(format!("cannot be written: {e}")).at_file(&args.out).into())
}

/// Whether two names, the first of a file that should be there, lead to one file.
fn is_same_file(a: &Path, b: &Path) -> bool {
    matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b)
}

/// Writes a file that others must not read: its permissions are narrowed before it holds anything.
fn write_private(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = created(path)?;
    #[cfg(unix)]
    if file.metadata()?.is_file() {
        use std::os::unix::fs::PermissionsExt;
        // An older file of that name keeps its own otherwise.
        file.set_permissions(std::fs::Permissions::from_mode(PRIVATE))?;
    }
    file.write_all(bytes)
}

/// Mode of a file that only its owner reads and writes.
#[cfg(unix)]
const PRIVATE: u32 = 0o600;

fn created(path: &Path) -> io::Result<File> {
    let mut options = OpenOptions::new();
    options.write(true).create(true).truncate(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, PRIVATE);
    options.open(path)
}
