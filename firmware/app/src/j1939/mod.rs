//! SAE J1939: the controller as a node on the drive's CAN bus. The only module that knows CAN frames.
//!
//! | module | duty |
//! |---|---|
//! | [`catalogue`] | description of every message and signal |
//! | [`signal`] | bit layout and coding of a signal |
//! | [`dbc`] | DBC file generated from the catalogue |
//! | [`claim`] | address claim |
//! | [`receive`] | readings received from other controllers |
//! | [`publish`], [`diagnostic_messages`] | encoding of estimates, health and trouble codes |
//! | [`transport`] | transport protocol for messages of more than eight bytes |
//! | [`example`] | example estimate for tests on host and target |
//! | [`node`] | complete node that combines the above |
//!
//! The module has no CAN driver, clock or task: frames and times are inputs, frames are outputs. [`Frame::from_can`]
//! and [`Frame::to_can`] convert from and to any `embedded_can::Frame`. `docs/can.md` is the manual.

pub mod catalogue;
pub mod claim;
pub mod dbc;
pub mod diagnostic_messages;
pub mod example;
mod id;
mod name;
pub mod node;
pub mod publish;
pub mod receive;
pub mod signal;
#[cfg(test)]
mod tests;
pub mod transport;

pub use claim::AddressClaim;
pub use id::{Frame, GLOBAL, Id, NULL_ADDRESS, Pgn};
pub use name::{Name, NameConfig, NameError};
pub use node::{Node, Outputs, Received};
pub use receive::DriveReadings;
