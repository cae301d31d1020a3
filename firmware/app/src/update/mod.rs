//! Calibration update over a bus: writes a new calibration, reads the present one and the learned state.
//!
//! | module | duty |
//! |---|---|
//! | [`wire`] | encoding of commands and answers in eight bytes |
//! | [`mac`] | authentication tag and source of its key |
//! | [`session`] | controller side: protocol state machine with its checks |
//! | [`service`] | session and record store with one owner |
//! | [`transfer`] | tool side: command sequence of one update |
//! | [`provision`] | key and first calibration, written by production |
//! | [`sizes`] | sizes of a transfer and of its buffer |
//!
//! An update is accepted only while the drive is not loaded, from a holder of the key, with a counter above that of
//! the last update, for this machine, and after the record has passed every check of the estimator. Until all of that
//! holds nothing changes; then it is written to flash and activated between two samples. The module handles bytes and
//! knows no bus. `docs/calibration-update.md` is the manual.

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
