//! Binary record of a [`State`]: what has been learned, kept over a loss of power without changing a bit.
//!
//! ```text
//! offset 0   magic    4 bytes  "KOUS"
//!        4   schema   u16 LE   1
//!        6   length   u16 LE   bytes of the payload
//!        8   payload           CRC-32 of the calibration's record, then the state, in postcard's wire format
//!        8+n crc      u32 LE   CRC-32/ISO-HDLC over everything before it
//! ```
//!
//! A state belongs to the calibration that it was learned with and is refused with another: the level is leakage over that
//! law's. Time stamps within are of the clock that the samples had. Where that clock starts anew, the first sample after
//! the restoring is refused as [`crate::Reason::TimeReversed`], and nothing else is lost.

use core::fmt;

use super::envelope::{RecordError, seal, unseal};
use crate::step::State;

/// First four bytes of every record.
pub const MAGIC: [u8; 4] = *b"KOUS";
/// Schema that this version writes and reads.
pub const SCHEMA: u16 = 2;
/// Bytes that always suffice for a record.
pub const MAX_LEN: usize = 800;

/// Why a saved state is refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum StateError {
    /// The record cannot be read or written.
    Record(RecordError),
    /// It was learned with another calibration, whose record has this CRC-32.
    OtherCalibration(u32),
    /// It holds numbers that no state can have.
    Unsound,
}

impl fmt::Display for StateError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Record(RecordError::Schema(found)) => {
                write!(f, "saved state of schema {found}; this version reads schema {SCHEMA}")
            }
            Self::Record(RecordError::Magic) => f.write_str("not a saved state: it does not begin with KOUS"),
            Self::Record(RecordError::Truncated) => f.write_str("the saved state is cut short"),
            Self::Record(RecordError::Excess) => f.write_str("there are bytes after the saved state's end"),
            Self::Record(RecordError::Crc) => {
                f.write_str("the saved state is damaged: its CRC-32 does not match")
            }
            Self::Record(RecordError::Payload) => f.write_str("the saved state's payload is not a state"),
            Self::Record(RecordError::Buffer) => f.write_str("the buffer is too small for the saved state"),
            Self::OtherCalibration(crc) => {
                write!(f, "the saved state was learned with another calibration, {crc:08x}")
            }
            Self::Unsound => f.write_str("the saved state holds numbers that no state can have"),
        }
    }
}

impl core::error::Error for StateError {}

/// Writes the record of a state that was learned with the calibration whose record has the CRC-32 `calibration` into
/// `buffer`, and returns its length. [`MAX_LEN`] bytes always suffice.
///
/// # Errors
/// [`StateError::Record`] with [`RecordError::Buffer`] when it does not fit.
pub fn encode(state: &State, calibration: u32, buffer: &mut [u8]) -> Result<usize, StateError> {
    seal(MAGIC, SCHEMA, &(calibration, state), buffer).map_err(StateError::Record)
}

/// Reads a record that fills `bytes` exactly, for use with the calibration whose record has the CRC-32 `calibration`.
///
/// # Errors
/// The first thing that is wrong; nothing of a damaged record is returned.
pub fn decode(bytes: &[u8], calibration: u32) -> Result<State, StateError> {
    let (of, state): (u32, State) = unseal(MAGIC, SCHEMA, bytes).map_err(StateError::Record)?;
    if of != calibration {
        return Err(StateError::OtherCalibration(of));
    }
    if state.health().is_sound() { Ok(state) } else { Err(StateError::Unsound) }
}
