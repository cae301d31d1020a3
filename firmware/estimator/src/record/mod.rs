//! Binary records of calibration and state: for flash and for the link.

pub mod calibration;
mod envelope;
pub mod state;

pub use envelope::{RecordError, crc32};
