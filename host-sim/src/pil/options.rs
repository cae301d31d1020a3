//! Options of a run through the firmware, and where the firmware's binaries are found.

use std::path::{Path, PathBuf};
use std::time::Duration;

/// Name of the firmware's binary.
const FIRMWARE: &str = "kou-qemu-mps2-an386";

/// Transport of the link's bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum LinkTransport {
    /// Files reached by semihosting: fast, and in lockstep.
    #[default]
    Files,
    /// The board's UART: slow, as on hardware, and bytes arrive whenever they arrive.
    Uart,
}

impl LinkTransport {
    /// The firmware's command line that selects this transport.
    pub(super) fn arguments(self) -> &'static [&'static str] {
        match self {
            Self::Files => &[],
            Self::Uart => &["kou", "uart"],
        }
    }
}

/// Program to run, and how.
#[derive(Debug, Clone)]
pub struct PilOptions {
    /// The firmware.
    pub firmware_elf: PathBuf,
    /// QEMU's program; a bare name is looked up in the path.
    pub qemu: PathBuf,
    /// Longest silence of the firmware before it counts as failed.
    pub timeout: Duration,
    /// Whether the firmware's clock counts instructions, and so is the same in every run. Off, QEMU is faster.
    pub deterministic: bool,
    /// Transport of the link's bytes.
    pub transport: LinkTransport,
}

impl Default for PilOptions {
    fn default() -> Self {
        Self {
            firmware_elf: find_binary(FIRMWARE),
            qemu: "qemu-system-arm".into(),
            timeout: Duration::from_secs(60),
            deterministic: true,
            transport: LinkTransport::Files,
        }
    }
}

impl PilOptions {
    /// Options for the board's binary `name` instead of the firmware.
    #[must_use]
    pub fn of_binary(name: &str) -> Self {
        Self { firmware_elf: find_binary(name), ..Self::default() }
    }
}

/// The firmware's binary `name` in the target folder that holds this program, or else below the working directory.
fn find_binary(name: &str) -> PathBuf {
    let below = |target: &Path| target.join("thumbv7em-none-eabihf").join("release").join(name);
    let own = std::env::current_exe().unwrap_or_default();
    own.ancestors()
        .skip(1)
        .map(below)
        .find(|path| path.is_file())
        .unwrap_or_else(|| below(Path::new(&std::env::var_os("CARGO_TARGET_DIR").unwrap_or("target".into()))))
}
