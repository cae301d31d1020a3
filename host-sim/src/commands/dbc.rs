//! `host-sim dbc`: the DBC file of the controller's CAN messages, generated from the firmware's own tables.

use std::path::PathBuf;

use kou_app::j1939::dbc;

use super::failure::Failure;
use super::output::print_text;
use crate::output_file::write_file;

/// Writes the DBC file of the controller's CAN messages.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// File to write; standard output when left out.
    #[arg(long, value_name = "FILE.dbc")]
    pub out: Option<PathBuf>,
}

/// Runs the command.
///
/// # Errors
/// When the file cannot be written.
pub fn run(args: &Args) -> Result<(), Failure> {
    let mut text = String::new();
    dbc::write(&mut text).map_err(|_| Failure::Check("the file cannot be generated".to_owned()))?;
    match &args.out {
        Some(path) => Ok(write_file(path, text)?),
        None => print_text(&text),
    }
}
