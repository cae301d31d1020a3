//! `host-sim dbc`: the DBC file of the controller's CAN messages, made from the firmware's own tables.

use std::path::PathBuf;

use kou_app::j1939::dbc;

use super::{Failure, print_text};
use kou_records::InputError;

/// Writes the DBC file of the controller's CAN messages.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Where to write it; standard output when left out.
    #[arg(long, value_name = "FILE.dbc")]
    pub out: Option<PathBuf>,
}

/// Runs the command.
///
/// # Errors
/// When the file cannot be written.
pub fn run(args: &Args) -> Result<(), Failure> {
    let mut text = String::new();
    dbc::write(&mut text).map_err(|_| Failure::Check("the file cannot be put together".to_owned()))?;
    match &args.out {
        Some(path) => {
            std::fs::write(path, text).map_err(|e| InputError::new(format!("{}: {e}", path.display())).into())
        }
        None => print_text(&text),
    }
}
