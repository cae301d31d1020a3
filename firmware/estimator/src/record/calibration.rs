//! Binary record of a calibration: for flash and for the link. Format in `docs/calibration-record.md`.
//!
//! ```text
//! offset 0   magic    4 bytes  "KOUC"
//!        4   schema   u16 LE   3
//!        6   length   u16 LE   bytes of the payload
//!        8   payload           the calibration in postcard's wire format
//!        8+n crc      u32 LE   CRC-32/ISO-HDLC over everything before it
//! ```
//!
//! A decoded record is not yet a trusted one: [`crate::Params::new`] checks it.

use core::fmt;

use super::envelope::{RecordError, seal, unseal};
use crate::calibration::Calibration;

/// First four bytes of every record.
pub const MAGIC: [u8; 4] = *b"KOUC";
/// Schema that this version writes and reads.
pub const SCHEMA: u16 = 3;
/// Bytes that always suffice for a record.
pub const MAX_LEN: usize = 880;

impl fmt::Display for RecordError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Truncated => f.write_str("the calibration record is cut short"),
            Self::Excess => f.write_str("there are bytes after the calibration record's end"),
            Self::Magic => f.write_str("not a calibration record: it does not begin with KOUC"),
            Self::Schema(found) => {
                write!(f, "calibration record of schema {found}; this version reads schema {SCHEMA}")
            }
            Self::Crc => f.write_str("the calibration record is damaged: its CRC-32 does not match"),
            Self::Payload => f.write_str("the calibration record's payload is not a calibration"),
            Self::Buffer => f.write_str("the buffer is too small for the calibration record"),
        }
    }
}

/// Writes the record into `buffer` and returns its length. [`MAX_LEN`] bytes always suffice.
///
/// # Errors
/// [`RecordError::Buffer`] when it does not fit.
pub fn encode(calibration: &Calibration, buffer: &mut [u8]) -> Result<usize, RecordError> {
    seal(MAGIC, SCHEMA, calibration, buffer)
}

/// Reads a record that fills `bytes` exactly.
///
/// # Errors
/// The first thing that is wrong; nothing of a damaged record is returned.
pub fn decode(bytes: &[u8]) -> Result<Calibration, RecordError> {
    unseal(MAGIC, SCHEMA, bytes)
}
