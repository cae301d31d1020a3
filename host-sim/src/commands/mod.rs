//! The commands of `host-sim`, one module each, and how they end.

pub mod dbc;
pub mod evaluate;
pub mod given;
pub mod identify;
mod lines;
pub mod paper;
pub mod pil;
pub mod point;
pub mod provision;
pub mod replay;
pub mod report;
pub mod simulate;
pub mod step;
pub mod synth;
pub mod update;
pub mod verify;

use std::process::ExitCode;

use kou_records::InputError;

/// Why a command did not end well.
#[derive(Debug, thiserror::Error)]
pub enum Failure {
    /// Bad input: exit code 2.
    #[error(transparent)]
    Input(#[from] InputError),
    /// Bad machine file or value for the lumped model: exit code 2.
    #[error(transparent)]
    Machine(#[from] kou_lumped::InvalidInput),
    /// A check failed: exit code 1.
    #[error("{0}")]
    Check(String),
}

impl Failure {
    /// Exit code that tells the two apart.
    #[must_use]
    pub fn exit_code(&self) -> ExitCode {
        match self {
            Self::Input(_) | Self::Machine(_) => ExitCode::from(2),
            Self::Check(_) => ExitCode::from(1),
        }
    }
}

/// Prints one JSON object on standard output.
///
/// # Errors
/// When standard output is closed.
fn print_json(value: &impl serde::Serialize) -> Result<(), Failure> {
    let text = serde_json::to_string_pretty(value)
        .map_err(|e| Failure::Check(format!("cannot be stated as JSON: {e}")))?;
    print_text(&text)
}

/// Prints text on standard output; a reader that has gone away (a pager that was closed) is no failure.
fn print_text(text: &str) -> Result<(), Failure> {
    use std::io::Write;
    match writeln!(std::io::stdout(), "{text}") {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(Failure::Check(format!("standard output cannot be written: {e}")))
        }
        _ => Ok(()),
    }
}

/// A bar on standard error that counts samples; hidden where standard error is no terminal.
fn progress(what: &'static str) -> indicatif::ProgressBar {
    let style =
        indicatif::ProgressStyle::with_template("{spinner} {msg}: {human_pos} samples, {per_sec}, {elapsed}")
            .unwrap_or_else(|_| indicatif::ProgressStyle::default_spinner());
    indicatif::ProgressBar::new_spinner().with_style(style).with_message(what)
}
