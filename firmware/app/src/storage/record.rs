//! The frame of a record in flash.
//!
//! ```text
//! offset 0   key       u8      kind of record and which of its two copies
//!        1   schema    u16 LE  of this kind of record
//!        3   sequence  u32 LE  higher is newer; both copies of a record have the same
//!        7   body              the record's fields in postcard's wire format
//!        7+n crc       u32 LE  CRC-32/ISO-HDLC over everything before it
//! ```
//!
//! Beneath it, sequential-storage keeps key, length and a CRC of its own; this one holds for the record wherever it is
//! and whatever library wrote it.

use kou_estimator::calibration::record::crc32;
use sequential_storage::map::{SerializationError, Value};
use serde::{Deserialize, Serialize};

/// Bytes before the body.
pub(super) const HEAD: usize = 7;
/// Bytes behind the body.
pub(super) const TAIL: usize = 4;

/// A kind of record. The number is the key in flash: append only.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Kind {
    /// Calibration and the counter of its update.
    Calibration = 0,
    /// Learned health.
    Health = 1,
    /// Fault memory.
    Faults = 2,
    /// Hours, restarts and their causes.
    Life = 3,
}

impl Kind {
    /// Every kind.
    pub const ALL: [Self; 4] = [Self::Calibration, Self::Health, Self::Faults, Self::Life];

    /// Key of one of the two copies.
    pub(super) const fn key(self, copy: Copy) -> u8 {
        ((self as u8) << 1) | copy as u8
    }
}

/// One of the two copies of a record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Copy {
    A = 0,
    B = 1,
}

/// Something that is kept in flash.
pub trait Record<'a>: Serialize + Deserialize<'a> {
    /// Its kind.
    const KIND: Kind;
    /// Number of its layout: raised with every change of a field, its order, its unit or its meaning.
    const SCHEMA: u16;

    /// The record from the body of an older schema; nothing where that is not read any more.
    #[must_use]
    fn migrate(_schema: u16, _body: &'a [u8]) -> Option<Self> {
        None
    }
}

/// A record on its way into flash.
pub(super) struct Outgoing<'r, R> {
    pub key: u8,
    pub sequence: u32,
    pub record: &'r R,
}

/// A record as it came out of flash: frame checked, body not yet understood.
#[derive(Debug, Clone, Copy)]
pub(super) struct Raw<'a> {
    /// Key under which it was written.
    pub key: u8,
    pub schema: u16,
    pub sequence: u32,
    pub body: &'a [u8],
}

/// Writes a frame; `fill` writes the body and says how long it is.
fn write_frame(
    key: u8,
    schema: u16,
    sequence: u32,
    buffer: &mut [u8],
    fill: impl FnOnce(&mut [u8]) -> Option<usize>,
) -> Option<usize> {
    let (head, rest) = buffer.split_first_chunk_mut::<HEAD>()?;
    let [s0, s1] = schema.to_le_bytes();
    let [q0, q1, q2, q3] = sequence.to_le_bytes();
    *head = [key, s0, s1, q0, q1, q2, q3];
    let room = rest.len().checked_sub(TAIL)?;
    let len = fill(rest.get_mut(..room)?)?;
    let covered = HEAD.saturating_add(len);
    let crc = crc32(buffer.get(..covered)?).to_le_bytes();
    *buffer.get_mut(covered..)?.first_chunk_mut::<TAIL>()? = crc;
    Some(covered.saturating_add(TAIL))
}

impl<'a, R: Serialize + Record<'a>> Value<'a> for Outgoing<'_, R> {
    fn serialize_into(&self, buffer: &mut [u8]) -> Result<usize, SerializationError> {
        write_frame(self.key, R::SCHEMA, self.sequence, buffer, |body| {
            postcard::to_slice(self.record, body).ok().map(|written| written.len())
        })
        .ok_or(SerializationError::BufferTooSmall)
    }

    fn deserialize_from(_: &'a [u8]) -> Result<(Self, usize), SerializationError> {
        Err(SerializationError::InvalidFormat)
    }
}

impl<'a> Value<'a> for Raw<'a> {
    fn serialize_into(&self, buffer: &mut [u8]) -> Result<usize, SerializationError> {
        write_frame(self.key, self.schema, self.sequence, buffer, |space| {
            space.get_mut(..self.body.len())?.copy_from_slice(self.body);
            Some(self.body.len())
        })
        .ok_or(SerializationError::BufferTooSmall)
    }

    fn deserialize_from(bytes: &'a [u8]) -> Result<(Self, usize), SerializationError> {
        Self::parse(bytes).map(|raw| (raw, bytes.len())).ok_or(SerializationError::InvalidFormat)
    }
}

impl<'a> Raw<'a> {
    /// The frame in these bytes; nothing when it is too short or its CRC does not match.
    fn parse(bytes: &'a [u8]) -> Option<Self> {
        let (covered, crc) = bytes.split_last_chunk::<TAIL>()?;
        let (&[key, s0, s1, q0, q1, q2, q3], body) = covered.split_first_chunk::<HEAD>()?;
        (crc32(covered).to_le_bytes() == *crc).then_some(Self {
            key,
            schema: u16::from_le_bytes([s0, s1]),
            sequence: u32::from_le_bytes([q0, q1, q2, q3]),
            body,
        })
    }

    /// The record, when it was written under this key.
    pub(super) fn under(self, key: u8) -> Option<Self> {
        (self.key == key).then_some(self)
    }

    /// What the body says.
    pub(super) fn decode<R: Record<'a>>(self) -> Result<R, DecodeError> {
        if self.schema != R::SCHEMA {
            return R::migrate(self.schema, self.body).ok_or(DecodeError::Schema(self.schema));
        }
        match postcard::take_from_bytes::<R>(self.body) {
            Ok((record, [])) => Ok(record),
            _ => Err(DecodeError::Body),
        }
    }
}

/// Why a whole record cannot be understood.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum DecodeError {
    /// Written by a version whose schema this one does not read.
    Schema(u16),
    /// The body is not such a record.
    Body,
}
