//! Calibration update over CAN: a new calibration in, the present one and the learned state out.
//!
//! | module | duty |
//! |---|---|
//! | [`wire`] | the eight bytes of each command and answer |
//! | [`mac`] | the authentication tag, and where its key comes from |
//! | [`session`] | the controller's side: takes commands, guards, refuses by name |
//! | [`service`] | session and store together, with one owner |
//! | [`transfer`] | the tool's side: makes the commands of one update |
//! | [`provision`] | key and first calibration, written by production |
//! | [`sizes`] | sizes of a transfer and of its buffer |
//!
//! An update is taken only while the drive is not loaded, from whoever holds the key, with a counter above the last
//! one's, for this very machine, and after the record has passed every check that the estimator makes. Until all of
//! that holds nothing changes; then it is written to flash and swapped between two samples. `docs/calibration-update.md`
//! is the manual.

pub mod mac;
pub mod provision;
pub mod service;
pub mod session;
pub mod sizes;
pub mod transfer;
pub mod wire;

pub use mac::{Key, KeySource, NoKey, TAG_LEN};
pub use service::{CommandOutcome, StartupCalibration, UpdateService};
pub use session::{ReadTarget, SessionAction, SessionOutcome, UpdateGuard, UpdateSession, is_loaded};
pub use sizes::{BUFFER_LEN, MAX_TRANSFER};
pub use transfer::UpdateTransfer;
