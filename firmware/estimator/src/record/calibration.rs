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

use crc::{CRC_32_ISO_HDLC, Crc, NoTable};
use serde::{Deserialize, Serialize};

use super::Calibration;
use crate::sealed::{seal, unseal};

/// First four bytes of every record.
pub const MAGIC: [u8; 4] = *b"KOUC";
/// Schema that this version writes and reads.
pub const SCHEMA: u16 = 3;
/// Bytes that always suffice for a record.
pub const MAX_LEN: usize = 880;

// Without a table: records are short and read seldom, and a table takes a kilobyte of flash.
static CRC: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);

/// CRC-32/ISO-HDLC, as used in records and for provenance.
#[must_use]
pub fn crc32(bytes: &[u8]) -> u32 {
    CRC.checksum(bytes)
}

/// Why a record is refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum RecordError {
    /// Fewer bytes than the header promises.
    Truncated,
    /// More bytes than the header promises.
    Excess,
    /// Not a calibration record at all.
    Magic,
    /// Written by a version whose schema this one does not read.
    Schema(u16),
    /// Damaged: the CRC does not match.
    Crc,
    /// The CRC matches, but the payload is not a calibration.
    Payload,
    /// The buffer is too small for the record.
    Buffer,
}

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

impl core::error::Error for RecordError {}

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
