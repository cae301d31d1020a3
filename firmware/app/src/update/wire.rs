//! Encoding of the update's commands and answers, eight bytes each; on CAN in frames of proprietary A (PGN 61184).
//!
//! ```text
//! command   byte 0  1        2..7
//! begin        01   version  length u16 LE (of the record), counter u32 LE
//! data         02   number   six bytes of record and tag, the last segment filled up with FF
//! commit       03   FF
//! abort        04   FF
//! read         11   target   FF                             1: calibration in use, 2: learned state, 3: last crash
//! next         12   number   FF
//!
//! answer    byte 0  1        2..7
//! begun        81   version  FF
//! accepted     82   number   of the next segment in order, FF
//! committed    83   FF       FF FF, CRC-32 of the record u32 LE
//! aborted      84   FF
//! read ready   91   target   length u16 LE, CRC-32 of all bytes u32 LE
//! segment      92   number   six bytes, the last segment filled up with FF
//! rejected     7F   command  number of the reason, FF, detail u32 LE (old counter: the last one)
//! ```

use super::mac::TAG_LEN;
use crate::diagnostics::RejectReason;

/// Version of this protocol.
pub const VERSION: u8 = 1;
/// Payload bytes of a segment.
pub const SEGMENT: usize = 6;

const BEGIN: u8 = 0x01;
const DATA: u8 = 0x02;
const COMMIT: u8 = 0x03;
const ABORT: u8 = 0x04;
const READ: u8 = 0x11;
const NEXT: u8 = 0x12;
const ANSWER: u8 = 0x80;
const REJECTED: u8 = 0x7F;

/// Command of a tool.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum UpdateCommand {
    /// Begins an update.
    Begin {
        /// Length of the record without the tag.
        length: u16,
        /// Counter of the update.
        counter: u32,
    },
    /// Next six bytes.
    Data {
        /// Number of the segment, from 0.
        number: u8,
        /// The bytes.
        bytes: [u8; SEGMENT],
    },
    /// End of the data: verify, write, activate.
    Commit,
    /// Discards the transfer.
    Abort,
    /// Begins a read-out: 1 calibration in use, 2 learned state, 3 last crash.
    Read {
        /// Number of the data to read.
        what: u8,
    },
    /// Requests six bytes of a read-out.
    Next {
        /// Number of the segment, from 0.
        number: u8,
    },
}

impl UpdateCommand {
    /// Decodes a command; `None` when this version does not know it.
    #[must_use]
    pub const fn from_bytes(bytes: [u8; 8]) -> Option<Self> {
        let [command, one, b2, b3, b4, b5, b6, b7] = bytes;
        Some(match command {
            BEGIN if one == VERSION => Self::Begin {
                length: u16::from_le_bytes([b2, b3]),
                counter: u32::from_le_bytes([b4, b5, b6, b7]),
            },
            DATA => Self::Data { number: one, bytes: [b2, b3, b4, b5, b6, b7] },
            COMMIT => Self::Commit,
            ABORT => Self::Abort,
            READ => Self::Read { what: one },
            NEXT => Self::Next { number: one },
            _ => return None,
        })
    }

    /// Encodes the command.
    #[must_use]
    pub const fn to_bytes(self) -> [u8; 8] {
        match self {
            Self::Begin { length, counter } => {
                let [l0, l1] = length.to_le_bytes();
                let [c0, c1, c2, c3] = counter.to_le_bytes();
                [BEGIN, VERSION, l0, l1, c0, c1, c2, c3]
            }
            Self::Data { number, bytes: [b0, b1, b2, b3, b4, b5] } => [DATA, number, b0, b1, b2, b3, b4, b5],
            Self::Commit => filled(COMMIT, 0xFF),
            Self::Abort => filled(ABORT, 0xFF),
            Self::Read { what } => filled(READ, what),
            Self::Next { number } => filled(NEXT, number),
        }
    }
}

/// Answer of the controller.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum UpdateAnswer {
    /// The update may be sent.
    Begun,
    /// The segment was accepted.
    SegmentAccepted {
        /// Number of the next segment in order.
        next: u8,
    },
    /// The calibration is in flash and in use.
    Committed {
        /// CRC-32 of its record.
        crc: u32,
    },
    /// The transfer is discarded.
    Aborted,
    /// The requested data can be read.
    ReadReady {
        /// Number of the data to read.
        what: u8,
        /// Length in bytes.
        length: u16,
        /// CRC-32/ISO-HDLC of its bytes.
        crc: u32,
    },
    /// Six bytes of a read-out.
    Segment {
        /// Number of the segment.
        number: u8,
        /// The bytes.
        bytes: [u8; SEGMENT],
    },
    /// The command was rejected.
    Rejected {
        /// First byte of the command.
        command: u8,
        /// Reason.
        reason: RejectReason,
        /// Detail of some reasons.
        detail: u32,
    },
}

impl UpdateAnswer {
    /// Decodes an answer; `None` when this version does not know it.
    #[must_use]
    pub fn from_bytes(bytes: [u8; 8]) -> Option<Self> {
        let [answer, one, b2, b3, b4, b5, b6, b7] = bytes;
        let last = u32::from_le_bytes([b4, b5, b6, b7]);
        Some(match answer {
            REJECTED => Self::Rejected { command: one, reason: RejectReason::from_number(b2)?, detail: last },
            _ => match answer.checked_sub(ANSWER)? {
                BEGIN => Self::Begun,
                DATA => Self::SegmentAccepted { next: one },
                COMMIT => Self::Committed { crc: last },
                ABORT => Self::Aborted,
                READ => Self::ReadReady { what: one, length: u16::from_le_bytes([b2, b3]), crc: last },
                NEXT => Self::Segment { number: one, bytes: [b2, b3, b4, b5, b6, b7] },
                _ => return None,
            },
        })
    }

    /// Encodes the answer.
    #[must_use]
    pub const fn to_bytes(self) -> [u8; 8] {
        match self {
            Self::Begun => filled(ANSWER | BEGIN, VERSION),
            Self::SegmentAccepted { next } => filled(ANSWER | DATA, next),
            Self::Committed { crc } => with_word(ANSWER | COMMIT, 0xFF, [0xFF; 2], crc),
            Self::Aborted => filled(ANSWER | ABORT, 0xFF),
            Self::ReadReady { what, length, crc } => {
                with_word(ANSWER | READ, what, length.to_le_bytes(), crc)
            }
            Self::Segment { number, bytes: [b0, b1, b2, b3, b4, b5] } => {
                [ANSWER | NEXT, number, b0, b1, b2, b3, b4, b5]
            }
            Self::Rejected { command, reason, detail } => {
                with_word(REJECTED, command, [reason.number(), 0xFF], detail)
            }
        }
    }
}

const fn filled(first: u8, second: u8) -> [u8; 8] {
    [first, second, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF]
}

const fn with_word(first: u8, second: u8, [third, fourth]: [u8; 2], word: u32) -> [u8; 8] {
    let [w0, w1, w2, w3] = word.to_le_bytes();
    [first, second, third, fourth, w0, w1, w2, w3]
}

/// Transfer length of a record of this length.
pub(super) const fn transfer_len(record_len: usize) -> usize {
    record_len.saturating_add(TAG_LEN)
}

/// Segment of these bytes, padded with FF; `None` beyond the end.
pub(super) fn segment(bytes: &[u8], number: u8) -> Option<[u8; SEGMENT]> {
    let chunk = bytes.chunks(SEGMENT).nth(usize::from(number))?;
    let mut out = [0xFF; SEGMENT];
    for (slot, byte) in out.iter_mut().zip(chunk) {
        *slot = *byte;
    }
    Some(out)
}
