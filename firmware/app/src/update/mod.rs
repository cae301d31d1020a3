//! Calibration update over CAN.

pub mod refusal;

pub use refusal::Refusal;
