//! Output of commands on the terminal: JSON, text, and progress bars.

use super::failure::Failure;

/// Prints one JSON object on standard output.
///
/// # Errors
/// When standard output is closed.
pub(super) fn print_json(value: &impl serde::Serialize) -> Result<(), Failure> {
    let text = serde_json::to_string_pretty(value)
        .map_err(|e| Failure::Check(format!("cannot be written as JSON: {e}")))?;
    print_text(&text)
}

/// Prints text on standard output; a reader that has gone away (a pager that was closed) is no failure.
pub(super) fn print_text(text: &str) -> Result<(), Failure> {
    use std::io::Write;
    match writeln!(std::io::stdout(), "{text}") {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(Failure::Check(format!("standard output cannot be written: {e}")))
        }
        _ => Ok(()),
    }
}

/// Progress bar on standard error that counts samples; hidden where that is no terminal.
pub(super) fn progress(what: &'static str) -> indicatif::ProgressBar {
    let style =
        indicatif::ProgressStyle::with_template("{spinner} {msg}: {human_pos} samples, {per_sec}, {elapsed}")
            .unwrap_or_else(|_| indicatif::ProgressStyle::default_spinner());
    indicatif::ProgressBar::new_spinner().with_style(style).with_message(what)
}
