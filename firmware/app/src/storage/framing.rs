//! Frame of a record in flash: key, schema, sequence number, body and CRC.
//!
//! ```text
//! offset 0   key       u8      kind of record and which of its two copies
//!        1   schema    u16 LE  of this kind of record
//!        3   sequence  u32 LE  higher is newer; both copies of a record have the same
//!        7   body              the record's fields in postcard's wire format
//!        7+n crc       u32 LE  CRC-32/ISO-HDLC over everything before it
//! ```
//!
//! Beneath it, sequential-storage adds key, length and a CRC of its own; this CRC protects the record independently
//! of the library that wrote it.

use kou_estimator::record::crc32;
use sequential_storage::map::{SerializationError, Value};
use serde::{Deserialize, Serialize};

/// Length of the header before the body.
pub(super) const HEAD: usize = 7;
/// Length of the CRC behind the body.
pub(super) const TAIL: usize = 4;

/// Kind of a record. The number is the key in flash: append only.
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
    /// Operating time, restarts and their causes.
    OperatingCounters = 3,
    /// Counter of the last accepted update, as a record of its own.
    UpdateCounter = 4,
    /// Last crash record.
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

    /// Name printed by reports.
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

    /// Kind of a number.
    #[must_use]
    pub fn from_number(number: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| *kind as u8 == number)
    }

    /// Flash key of one of the two copies.
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

/// Data that is stored in flash as a record.
pub trait Record<'a>: Serialize + Deserialize<'a> {
    /// Kind of the record.
    const KIND: RecordKind;
    /// Number of its layout: incremented with every change of a field, its order, its unit or its meaning.
    const SCHEMA: u16;

    /// Converts the body of an older schema; `None` if that schema is no longer supported.
    #[must_use]
    fn migrate(_schema: u16, _body: &'a [u8]) -> Option<Self> {
        None
    }
}

/// Writer of a record's body; used as a trait object, so that the writing code exists once for all kinds.
pub(super) trait WriteBody {
    /// Writes the body and returns its length; `None` when it does not fit.
    fn write_body(&self, body: &mut [u8]) -> Option<usize>;
}

/// Fields to be serialised in postcard's wire format.
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

/// Record to be written.
#[derive(Clone, Copy)]
pub(super) struct OutgoingFrame<'r> {
    pub key: u8,
    pub schema: u16,
    pub sequence: u32,
    pub body: &'r dyn WriteBody,
}

/// Record as read: frame checked, body not yet decoded.
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
        // Records are written as an `OutgoingFrame`.
        Err(SerializationError::InvalidData)
    }

    fn deserialize_from(bytes: &'a [u8]) -> Result<(Self, usize), SerializationError> {
        Self::parse(bytes).map(|raw| (raw, bytes.len())).ok_or(SerializationError::InvalidFormat)
    }
}

impl<'a> StoredFrame<'a> {
    /// Parses a frame; `None` when it is too short or its CRC does not match.
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

    /// The frame, if it was written under this key.
    pub(super) fn with_key(self, key: u8) -> Option<Self> {
        (self.key == key).then_some(self)
    }

    /// Decodes the body.
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

/// Reason why an intact record cannot be decoded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum DecodeError {
    /// Unsupported schema.
    Schema(u16),
    /// The body is not a record of this kind.
    Body,
}
