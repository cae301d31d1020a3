//! Errors of a run through the firmware.

use std::fmt;
use std::path::PathBuf;
use std::time::Duration;

use kou_pil::link::{CalibrationRejection, EncodeError};

/// Command that installs QEMU on Debian and its descendants.
pub const INSTALL_QEMU: &str = "sudo apt-get install --no-install-recommends qemu-system-arm";
/// Commands that build the firmware for QEMU, from the workspace's root.
pub const BUILD_FIRMWARE: &str = "cd firmware/boards/qemu-mps2-an386 && cargo build --release";

/// Plain text that the firmware printed, most often a panic or a fault; empty where it printed nothing.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ConsoleText(pub String);

impl fmt::Display for ConsoleText {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0.trim() {
            "" => Ok(()),
            text => write!(f, "; it printed:\n{text}"),
        }
    }
}

/// Error that ends a run through the firmware.
#[derive(Debug, thiserror::Error)]
pub enum PilError {
    /// QEMU is not installed.
    #[error("`{program}` was not found; install it with `{INSTALL_QEMU}` or what your system has instead")]
    QemuMissing {
        /// Program that was looked for.
        program: String,
    },
    /// The firmware has not been built.
    #[error("there is no firmware at {}; build it with `{BUILD_FIRMWARE}`", path.display())]
    FirmwareMissing {
        /// Searched path.
        path: PathBuf,
    },
    /// A call of the operating system failed.
    #[error("{doing}: {cause}")]
    System {
        /// Failed operation.
        doing: &'static str,
        /// Cause.
        cause: std::io::Error,
    },
    /// The firmware is silent.
    #[error("the firmware did not answer within {} s{printed}", after.as_secs_f64())]
    Timeout {
        /// Timeout.
        after: Duration,
        /// Text output of the firmware.
        printed: ConsoleText,
    },
    /// QEMU ended early.
    #[error("the firmware ended with exit code {}{printed}", code_text(*code))]
    Ended {
        /// Exit code, where there is one: a killed process has none.
        code: Option<i32>,
        /// Text output of the firmware.
        printed: ConsoleText,
    },
    /// The firmware rejected the calibration.
    #[error("the firmware rejected the calibration: {0}")]
    CalibrationRejected(CalibrationRejection<String>),
    /// The firmware speaks another version of the link's protocol.
    #[error("the firmware speaks version {firmware} of the link's protocol, this program version {host}")]
    Version {
        /// The firmware's version.
        firmware: u16,
        /// This program's version.
        host: u16,
    },
    /// The response does not belong to the request.
    #[error("unexpected answer of the firmware to {request}: {answer}")]
    Unexpected {
        /// Request.
        request: &'static str,
        /// Answer.
        answer: String,
    },
    /// A message does not fit into a frame.
    #[error("{0}")]
    Encode(#[from] EncodeError),
}

fn code_text(code: Option<i32>) -> String {
    code.map_or_else(|| "none (killed)".into(), |code| code.to_string())
}

impl PilError {
    pub(super) fn system(doing: &'static str) -> impl FnOnce(std::io::Error) -> Self {
        move |cause| Self::System { doing, cause }
    }
}
