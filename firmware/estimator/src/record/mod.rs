//! Binary records of calibration and state, for flash and link: envelope with CRC and schema around a postcard payload.

pub mod calibration;
mod envelope;
pub mod state;

pub use envelope::{RecordError, crc32};
