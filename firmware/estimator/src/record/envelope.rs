//! Envelope of every binary record: magic, schema, length, payload in postcard's wire format, and a CRC over all of it.

use core::fmt;

use crc::{CRC_32_ISO_HDLC, Crc, NoTable};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

// Without a table: records are short and seldom read, and a table occupies a kilobyte of flash.
static CRC: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);

const HEADER_LEN: usize = 8;
const CRC_LEN: usize = 4;

/// CRC-32/ISO-HDLC, as used in records and for provenance.
#[must_use]
#[doc(alias = "checksum")]
pub fn crc32(bytes: &[u8]) -> u32 {
    CRC.checksum(bytes)
}

/// Reason for which a record is rejected.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum RecordError {
    /// Fewer bytes than the header states.
    Truncated,
    /// More bytes than the header states.
    Excess,
    /// Not a record of this kind.
    Magic,
    /// Written by a version whose schema this one does not read.
    Schema(u16),
    /// Damaged: the CRC does not match.
    Crc,
    /// The CRC matches, but the payload cannot be decoded.
    Payload,
    /// The buffer is too small for the record.
    Buffer,
}

impl core::error::Error for RecordError {}

/// Format of one kind of record, with the words of its messages.
pub struct RecordFormat {
    /// First four bytes.
    pub magic: [u8; 4],
    /// Schema that this version writes and reads.
    pub schema: u16,
    /// Name of the record.
    pub name: &'static str,
    /// Name of its content.
    pub content: &'static str,
}

impl RecordFormat {
    /// Message of an error of a record of this format.
    pub fn describe(&self, error: RecordError, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { magic, schema, name, content } = self;
        match error {
            RecordError::Truncated => write!(f, "the {name} is cut short"),
            RecordError::Excess => write!(f, "there are bytes after the {name}'s end"),
            RecordError::Magic => {
                let magic = core::str::from_utf8(magic).unwrap_or_default();
                write!(f, "not a {name}: it does not begin with {magic}")
            }
            RecordError::Schema(found) => {
                write!(f, "{name} of schema {found}; this version reads schema {schema}")
            }
            RecordError::Crc => write!(f, "the {name} is damaged: its CRC-32 does not match"),
            RecordError::Payload => write!(f, "the {name}'s payload is not a {content}"),
            RecordError::Buffer => write!(f, "the buffer is too small for the {name}"),
        }
    }

    /// Writes a record into `buffer` and returns its length.
    pub fn encode(&self, content: &impl Serialize, buffer: &mut [u8]) -> Result<usize, RecordError> {
        let payload = buffer.get_mut(HEADER_LEN..).ok_or(RecordError::Buffer)?;
        let length = postcard::to_slice(content, payload).map_err(|_| RecordError::Buffer)?.len();
        let length_field = u16::try_from(length).map_err(|_| RecordError::Buffer)?;
        let mut header =
            self.magic.into_iter().chain(self.schema.to_le_bytes()).chain(length_field.to_le_bytes());
        for (slot, byte) in buffer.iter_mut().zip(&mut header) {
            *slot = byte;
        }
        let body_len = HEADER_LEN.saturating_add(length);
        let crc = crc32(buffer.get(..body_len).ok_or(RecordError::Buffer)?).to_le_bytes();
        let end = body_len.saturating_add(CRC_LEN);
        let tail = buffer.get_mut(body_len..end).ok_or(RecordError::Buffer)?;
        for (slot, byte) in tail.iter_mut().zip(crc) {
            *slot = byte;
        }
        Ok(end)
    }

    /// Reads a record that fills `bytes` exactly.
    pub fn decode<T: DeserializeOwned>(&self, bytes: &[u8]) -> Result<T, RecordError> {
        let (found_magic, rest) = bytes.split_first_chunk::<4>().ok_or(RecordError::Truncated)?;
        if *found_magic != self.magic {
            return Err(RecordError::Magic);
        }
        let (found_schema, rest) = rest.split_first_chunk::<2>().ok_or(RecordError::Truncated)?;
        let found_schema = u16::from_le_bytes(*found_schema);
        if found_schema != self.schema {
            return Err(RecordError::Schema(found_schema));
        }
        let (length, rest) = rest.split_first_chunk::<2>().ok_or(RecordError::Truncated)?;
        let length = usize::from(u16::from_le_bytes(*length));
        let (payload, rest) = rest.split_at_checked(length).ok_or(RecordError::Truncated)?;
        let (crc, excess) = rest.split_first_chunk::<4>().ok_or(RecordError::Truncated)?;
        if !excess.is_empty() {
            return Err(RecordError::Excess);
        }
        let covered = bytes.get(..HEADER_LEN.saturating_add(length)).ok_or(RecordError::Truncated)?;
        if crc32(covered) != u32::from_le_bytes(*crc) {
            return Err(RecordError::Crc);
        }
        let (content, rest) = postcard::take_from_bytes::<T>(payload).map_err(|_| RecordError::Payload)?;
        if rest.is_empty() { Ok(content) } else { Err(RecordError::Payload) }
    }
}
