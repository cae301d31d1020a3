//! Processor in the loop: samples through the firmware in QEMU, estimates back.
//!
//! | module | duty |
//! |---|---|
//! | `stream` | a record of samples through the firmware: [`run`] |
//! | `session` | requests and responses one by one, and arbitrary bytes for tests: [`PilSession`] |
//! | [`plant`] | closed loop with a simulated vehicle |
//! | `qemu_link`, `qemu` | the link's FIFOs; the QEMU process |
//! | `options`, `error` | what is run, and what can fail |
//!
//! The exchange is in lockstep, a batch of samples out and their estimates back, so that a run gives the same bits and the
//! same firmware time again. QEMU is killed on every way out, and every wait has a limit.
//!
//! Needs a system with FIFOs: Linux, macOS, or Windows through WSL.

mod error;
mod options;
pub mod plant;
mod qemu;
mod qemu_link;
mod session;
mod stream;

pub use error::{BUILD_FIRMWARE, ConsoleText, INSTALL_QEMU, PilError};
pub use options::{LinkTransport, PilOptions};
pub use session::{BATCH_LEN, FirmwareExit, FirmwareResponse, PilSession, frame, run_to_end};
pub use stream::{PilReport, run, same_bits};
