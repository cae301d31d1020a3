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
pub enum RecordKind {
    /// Calibration and the counter of its update.
    Calibration = 0,
    /// Learned health.
    Health = 1,
    /// Fault memory.
    Faults = 2,
    /// Hours, restarts and their causes.
    OperatingCounters = 3,
    /// Counter of the last accepted update, by itself.
    UpdateCounter = 4,
    /// The last note that outlived a reset.
    Stop = 5,
}

impl RecordKind {
    /// Every kind.
    pub const ALL: [Self; 6] = [
        Self::Calibration,
        Self::Health,
        Self::Faults,
        Self::OperatingCounters,
        Self::UpdateCounter,
        Self::Stop,
    ];

    /// Name as reports print it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Calibration => "calibration",
            Self::Health => "health",
            Self::Faults => "faults",
            Self::OperatingCounters => "life",
            Self::UpdateCounter => "update_counter",
            Self::Stop => "stop",
        }
    }

    /// The kind of this number.
    #[must_use]
    pub fn from_number(number: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| *kind as u8 == number)
    }

    /// Key of one of the two copies.
    pub(super) const fn key(self, copy: RecordCopy) -> u8 {
        ((self as u8) << 1) | copy as u8
    }
}

/// One of the two copies of a record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum RecordCopy {
    A = 0,
    B = 1,
}

/// Something that is kept in flash.
pub trait Record<'a>: Serialize + Deserialize<'a> {
    /// Its kind.
    const KIND: RecordKind;
    /// Number of its layout: raised with every change of a field, its order, its unit or its meaning.
    const SCHEMA: u16;

    /// The record from the body of an older schema; nothing where that is not read any more.
    #[must_use]
    fn migrate(_schema: u16, _body: &'a [u8]) -> Option<Self> {
        None
    }
}

/// Something that writes the body of a record; an object, so that the code that writes is there once for all kinds.
pub(super) trait WriteBody {
    /// Writes the body and says how long it is; nothing when it does not fit.
    fn write_body(&self, body: &mut [u8]) -> Option<usize>;
}

/// Fields, to be written in postcard's wire format.
pub(super) struct Fields<'r, R>(pub &'r R);

impl<R: Serialize> WriteBody for Fields<'_, R> {
    fn write_body(&self, body: &mut [u8]) -> Option<usize> {
        postcard::to_slice(self.0, body).ok().map(|written| written.len())
    }
}

impl WriteBody for &[u8] {
    fn write_body(&self, body: &mut [u8]) -> Option<usize> {
        body.get_mut(..self.len())?.copy_from_slice(self);
        Some(self.len())
    }
}

/// A record on its way into flash.
#[derive(Clone, Copy)]
pub(super) struct OutgoingFrame<'r> {
    pub key: u8,
    pub schema: u16,
    pub sequence: u32,
    pub body: &'r dyn WriteBody,
}

/// A record as it came out of flash: frame checked, body not yet understood.
#[derive(Debug, Clone, Copy)]
pub(super) struct StoredFrame<'a> {
    /// Key under which it was written.
    pub key: u8,
    pub schema: u16,
    pub sequence: u32,
    pub body: &'a [u8],
}

impl<'a> Value<'a> for OutgoingFrame<'_> {
    fn serialize_into(&self, buffer: &mut [u8]) -> Result<usize, SerializationError> {
        let mut write = || {
            let (head, rest) = buffer.split_first_chunk_mut::<HEAD>()?;
            let [s0, s1] = self.schema.to_le_bytes();
            let [q0, q1, q2, q3] = self.sequence.to_le_bytes();
            *head = [self.key, s0, s1, q0, q1, q2, q3];
            let room = rest.len().checked_sub(TAIL)?;
            let covered = HEAD.saturating_add(self.body.write_body(rest.get_mut(..room)?)?);
            let crc = crc32(buffer.get(..covered)?).to_le_bytes();
            *buffer.get_mut(covered..)?.first_chunk_mut::<TAIL>()? = crc;
            Some(covered.saturating_add(TAIL))
        };
        write().ok_or(SerializationError::BufferTooSmall)
    }

    fn deserialize_from(_: &'a [u8]) -> Result<(Self, usize), SerializationError> {
        Err(SerializationError::InvalidFormat)
    }
}

impl<'a> Value<'a> for StoredFrame<'a> {
    fn serialize_into(&self, _: &mut [u8]) -> Result<usize, SerializationError> {
        // What is written is an `OutgoingFrame`.
        Err(SerializationError::InvalidData)
    }

    fn deserialize_from(bytes: &'a [u8]) -> Result<(Self, usize), SerializationError> {
        Self::parse(bytes).map(|raw| (raw, bytes.len())).ok_or(SerializationError::InvalidFormat)
    }
}

impl<'a> StoredFrame<'a> {
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
    pub(super) fn with_key(self, key: u8) -> Option<Self> {
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
