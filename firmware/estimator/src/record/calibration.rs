//! Binary record of a calibration, for flash and link. Format in `docs/calibration-record.md`.
//!
//! ```text
//! offset 0   magic    4 bytes  "KOUC"
//!        4   schema   u16 LE   3
//!        6   length   u16 LE   bytes of the payload
//!        8   payload           the calibration in postcard's wire format
//!        8+n crc      u32 LE   CRC-32/ISO-HDLC over everything before it
//! ```
//!
//! A decoded calibration is not yet validated: [`crate::Params::new`] does that.

use core::fmt;

use super::envelope::{RecordError, RecordFormat};
use crate::calibration::Calibration;

/// First four bytes of every record.
pub const MAGIC: [u8; 4] = *b"KOUC";
/// Schema that this version writes and reads.
pub const SCHEMA: u16 = 3;
/// Bytes that suffice for every record.
pub const MAX_LEN: usize = 880;

const FORMAT: RecordFormat =
    RecordFormat { magic: MAGIC, schema: SCHEMA, name: "calibration record", content: "calibration" };

/// Worded for calibration records; [`StateError`](super::state::StateError) words the errors of saved states.
impl fmt::Display for RecordError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        FORMAT.describe(*self, f)
    }
}

/// Encodes a calibration into `buffer` and returns the record's length. [`MAX_LEN`] bytes always suffice.
///
/// # Errors
/// [`RecordError::Buffer`] when it does not fit.
pub fn encode(calibration: &Calibration, buffer: &mut [u8]) -> Result<usize, RecordError> {
    FORMAT.encode(calibration, buffer)
}

/// Decodes a record that fills `bytes` exactly.
///
/// # Errors
/// The first problem found; nothing of a damaged record is returned.
pub fn decode(bytes: &[u8]) -> Result<Calibration, RecordError> {
    FORMAT.decode(bytes)
}
