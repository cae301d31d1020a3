//! Binary record of a [`State`]: learned state that survives a loss of power bit for bit.
//!
//! ```text
//! offset 0   magic    4 bytes  "KOUS"
//!        4   schema   u16 LE   2
//!        6   length   u16 LE   bytes of the payload
//!        8   payload           CRC-32 of the calibration's record, then the state, in postcard's wire format
//!        8+n crc      u32 LE   CRC-32/ISO-HDLC over everything before it
//! ```
//!
//! A state belongs to the calibration with which it was learned and is rejected with another: the level is leakage over
//! that law's. Time stamps are of the clock of the samples. Where that clock restarts, the first sample after the
//! restart is rejected as [`crate::Reason::TimeReversed`], and nothing else is lost.

use core::fmt;

use super::envelope::{RecordError, RecordFormat};
use crate::step::State;

/// First four bytes of every record.
pub const MAGIC: [u8; 4] = *b"KOUS";
/// Schema that this version writes and reads.
pub const SCHEMA: u16 = 2;
/// Bytes that suffice for every record.
pub const MAX_LEN: usize = 800;

const FORMAT: RecordFormat =
    RecordFormat { magic: MAGIC, schema: SCHEMA, name: "saved state", content: "state" };

/// Reason for which a saved state is rejected.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum StateError {
    /// The record cannot be decoded or encoded.
    Record(RecordError),
    /// It was learned with another calibration, whose record has this CRC-32.
    OtherCalibration(u32),
    /// It contains numbers that no state can have.
    Unsound,
}

impl fmt::Display for StateError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Record(error) => FORMAT.describe(*error, f),
            Self::OtherCalibration(crc) => {
                write!(f, "the saved state was learned with another calibration, {crc:08x}")
            }
            Self::Unsound => f.write_str("the saved state holds numbers that no state can have"),
        }
    }
}

impl core::error::Error for StateError {}

/// Encodes a state into `buffer` and returns the record's length; `calibration` is the CRC-32 of the record of the
/// calibration with which it was learned. [`MAX_LEN`] bytes always suffice.
///
/// # Errors
/// [`StateError::Record`] with [`RecordError::Buffer`] when it does not fit.
pub fn encode(state: &State, calibration: u32, buffer: &mut [u8]) -> Result<usize, StateError> {
    FORMAT.encode(&(calibration, state), buffer).map_err(StateError::Record)
}

/// Decodes a record that fills `bytes` exactly, for use with the calibration whose record has the CRC-32 `calibration`.
///
/// # Errors
/// The first problem found; nothing of a damaged record is returned.
pub fn decode(bytes: &[u8], calibration: u32) -> Result<State, StateError> {
    let (of, state): (u32, State) = FORMAT.decode(bytes).map_err(StateError::Record)?;
    if of != calibration {
        return Err(StateError::OtherCalibration(of));
    }
    if state.health().is_sound() { Ok(state) } else { Err(StateError::Unsound) }
}
