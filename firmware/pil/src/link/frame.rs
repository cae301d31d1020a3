//! Frames: payload and CRC-32/ISO-HDLC (little-endian), COBS-encoded, terminated by a zero.
//!
//! [`FrameDecoder`] accepts bytes in pieces of any size and has a buffer of fixed size. Each non-empty stretch
//! between two zeros yields exactly one payload or one [`FrameError`], whatever the bytes; consecutive zeros have no
//! effect, so a sender may start with a few of them to terminate any garbage on the line.

use core::fmt;

use kou_estimator::record::crc32;
use serde::{Deserialize, Serialize};

use super::cobs::{self, CobsDecoder, CobsEvent};
use super::sizes::{CRC_LEN, MAX_BODY};

/// Reason for rejecting a frame. On the wire by position: append only.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum FrameError {
    /// Longer than the receiver's buffer.
    TooLong,
    /// Too short to hold a payload and a CRC.
    TooShort,
    /// The last COBS block is truncated.
    Cobs,
    /// The CRC does not match.
    Crc,
    /// The CRC matches, but the message's tag is unknown to this version.
    Unknown,
    /// CRC and tag match, but the rest is not that message.
    Payload,
}

impl FrameError {
    /// Every error, in the order on the wire.
    pub const ALL: [Self; 6] =
        [Self::TooLong, Self::TooShort, Self::Cobs, Self::Crc, Self::Unknown, Self::Payload];
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::TooLong => "the frame is longer than the receiver's buffer",
            Self::TooShort => "the frame is too short for a payload and its CRC",
            Self::Cobs => "the frame is cut inside a COBS block",
            Self::Crc => "the frame is damaged: its CRC-32 does not match",
            Self::Unknown => "the frame's message is not known to this version",
            Self::Payload => "the frame's payload is not the message that its tag says",
        })
    }
}

impl core::error::Error for FrameError {}

/// Reason why a message could not be encoded as a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum EncodeError {
    /// Message larger than the largest frame.
    Message,
    /// Frame larger than the output buffer.
    Buffer,
}

impl fmt::Display for EncodeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Message => "the message is larger than any frame may be",
            Self::Buffer => "the frame does not fit the output buffer",
        })
    }
}

impl core::error::Error for EncodeError {}

/// Encodes `message` as one frame into `out` and returns its length including the delimiter.
///
/// `BODY` is the largest payload with its CRC: the size of a working buffer on the stack.
///
/// # Errors
/// The message or the frame is too large; `out` then holds no frame.
pub fn encode<const BODY: usize>(message: &impl Serialize, out: &mut [u8]) -> Result<usize, EncodeError> {
    let mut body = [0; BODY];
    let space = body.len().checked_sub(CRC_LEN).ok_or(EncodeError::Message)?;
    let payload = body.get_mut(..space).ok_or(EncodeError::Message)?;
    let len = postcard::to_slice(message, payload).map_err(|_| EncodeError::Message)?.len();
    let (payload, rest) = body.split_at_mut_checked(len).ok_or(EncodeError::Message)?;
    let (crc, _) = rest.split_first_chunk_mut::<CRC_LEN>().ok_or(EncodeError::Message)?;
    *crc = crc32(payload).to_le_bytes();
    let body = body.get(..len.saturating_add(CRC_LEN)).ok_or(EncodeError::Message)?;
    let encoded = cobs::encode(body, out).ok_or(EncodeError::Buffer)?;
    *out.get_mut(encoded).ok_or(EncodeError::Buffer)? = 0;
    Ok(encoded.saturating_add(1))
}

/// Decoder of frames of at most `N` bytes (payload and CRC).
#[derive(Debug, Clone)]
pub struct FrameDecoder<const N: usize = MAX_BODY> {
    buffer: [u8; N],
    len: usize,
    decoder: CobsDecoder,
    too_long: bool,
}

impl<const N: usize> Default for FrameDecoder<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> FrameDecoder<N> {
    /// Decoder at the start of a frame.
    #[must_use]
    pub const fn new() -> Self {
        Self { buffer: [0; N], len: 0, decoder: CobsDecoder::new(), too_long: false }
    }

    /// Accepts one byte; at the end of a frame returns its payload or its error.
    #[inline]
    pub fn push(&mut self, byte: u8) -> Option<Result<&[u8], FrameError>> {
        match self.decoder.push(byte) {
            CobsEvent::Nothing | CobsEvent::Empty => None,
            CobsEvent::Byte(byte) => {
                match self.buffer.get_mut(self.len) {
                    Some(slot) => {
                        *slot = byte;
                        self.len = self.len.saturating_add(1);
                    }
                    None => self.too_long = true,
                }
                None
            }
            CobsEvent::End => Some(self.finish(false)),
            CobsEvent::Cut => Some(self.finish(true)),
        }
    }

    /// Checks the frame that has just ended, and prepares for the next.
    fn finish(&mut self, cut: bool) -> Result<&[u8], FrameError> {
        let len = core::mem::take(&mut self.len);
        if core::mem::take(&mut self.too_long) {
            return Err(FrameError::TooLong);
        }
        if cut {
            return Err(FrameError::Cobs);
        }
        let body = self.buffer.get(..len).ok_or(FrameError::TooLong)?;
        match body.split_last_chunk::<CRC_LEN>() {
            Some(([], _)) => Err(FrameError::TooShort),
            Some((payload, crc)) if crc32(payload) == u32::from_le_bytes(*crc) => Ok(payload),
            Some(_) => Err(FrameError::Crc),
            None => Err(FrameError::TooShort),
        }
    }
}
