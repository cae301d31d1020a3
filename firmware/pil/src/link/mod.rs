//! The link between host and firmware: messages ([`message`]) in checked frames ([`frame`]).
//!
//! One frame is COBS over (postcard payload + CRC-32), closed by a zero byte, which occurs nowhere else on the line; so
//! a receiver that lost its place finds it again at the next zero. Every request is answered by exactly one response,
//! in order. A frame that is damaged, cut short or unknown is counted and answered with an error; it is never obeyed.
//! The same code runs at both ends. `docs/link.md` has an example byte by byte.

pub mod cobs;
pub mod frame;
pub mod message;
#[cfg(test)]
mod tests;

pub use frame::{EncodeError, FrameDecoder, FrameError, encode};
pub use message::{
    Counts, ErrorKind, FieldProblem, Hello, PROTOCOL, Refusal, Request, Response, Status, decode_request,
    decode_response,
};

use kou_estimator::calibration::record;

/// Bytes of CRC behind the payload.
pub const CRC_LEN: usize = 4;
/// Largest payload: a calibration record with its tag and its length.
pub const MAX_PAYLOAD: usize = record::MAX_LEN + 8;
/// Largest frame before stuffing: payload and CRC.
pub const MAX_BODY: usize = MAX_PAYLOAD + CRC_LEN;
/// Largest frame on the line, its closing zero included.
pub const MAX_FRAME: usize = cobs::max_encoded_len(MAX_BODY) + 1;
/// Largest payload of a response: a refusal that names a field and says why.
pub const MAX_RESPONSE_PAYLOAD: usize = 192;
/// Largest response on the line, its closing zero included.
pub const MAX_RESPONSE_FRAME: usize = cobs::max_encoded_len(MAX_RESPONSE_PAYLOAD + CRC_LEN) + 1;
