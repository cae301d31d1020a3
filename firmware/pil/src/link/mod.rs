//! Link between host and firmware: messages ([`message`]) in checked frames ([`frame`]).
//!
//! A frame is the COBS encoding of a postcard payload and its CRC-32, terminated by a zero byte, which occurs nowhere
//! else; a receiver therefore resynchronises at the next zero. Every request is answered by exactly one response, in
//! order. A damaged, truncated or unknown frame is counted and answered with an error; it is never executed. Both
//! ends use the same code. `docs/link.md` has an example byte by byte.

pub mod cobs;
pub mod frame;
pub mod message;
pub mod sizes;
#[cfg(test)]
mod tests;

pub use frame::{EncodeError, FrameDecoder, FrameError, encode};
pub use message::{
    CalibrationRejection, ErrorKind, FieldProblem, Hello, LinkCounts, PROTOCOL, Request, Response, Status,
    decode_request, decode_response,
};
pub use sizes::{CRC_LEN, MAX_BODY, MAX_FRAME, MAX_PAYLOAD, MAX_RESPONSE_FRAME, MAX_RESPONSE_PAYLOAD};
