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
//! | [`refusal`] | why something is refused |
//!
//! An update is taken only while the drive is not loaded, from whoever holds the key, with a counter above the last
//! one's, for this very machine, and after the record has passed every check that the estimator makes. Until all of
//! that holds nothing changes; then it is written to flash and swapped between two samples. `docs/calibration-update.md`
//! is the manual.

pub mod mac;
pub mod provision;
pub mod refusal;
pub mod service;
pub mod session;
pub mod transfer;
pub mod wire;

pub use mac::{Key, KeySource, NoKey, TAG_LEN};
pub use refusal::Refusal;
pub use service::{Handled, Opened, Service};
pub use session::{Guard, Machine, Outcome, Session, Todo, What, is_loaded};
pub use transfer::Transfer;

use kou_estimator::record;

use crate::storage;

/// Longest transfer: a calibration record and its tag.
pub const MAX_TRANSFER: usize = record::calibration::MAX_LEN + TAG_LEN;

/// Bytes of the session's buffer, which also serves as [`crate::storage::Store::heal`]'s scratch memory.
pub const BUFFER_LEN: usize =
    if MAX_TRANSFER > storage::BUFFER_LEN { MAX_TRANSFER } else { storage::BUFFER_LEN };

// A segment's number is one byte.
const _: () = assert!(MAX_TRANSFER <= 256 * wire::SEGMENT);
