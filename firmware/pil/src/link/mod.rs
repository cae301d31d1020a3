//! The link between host and firmware: messages ([`message`]) in checked frames ([`frame`]).
//!
//! One frame is COBS over (postcard payload + CRC-32), closed by a zero byte, which occurs nowhere else on the line; so
//! a receiver that lost its place finds it again at the next zero. Every request is answered by exactly one response,
//! in order. A frame that is damaged, cut short or unknown is counted and answered with an error; it is never obeyed.
//! The same code runs at both ends. `docs/link.md` has an example byte by byte.

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
