//! SAE J1939: the controller on the drive's CAN bus.
//!
//! | module | duty |
//! |---|---|
//! | [`catalogue`] | every message and signal, described once |
//! | [`signal`] | what a description is, and how it reads and writes bits |
//! | [`dbc`] | the DBC file, made of the catalogue |
//! | [`claim`] | address claim |
//! | [`receive`] | readings from the bus |
//! | [`publish`], [`diagnostic_messages`] | estimates, health and troubles as bytes |
//! | [`transport`] | messages of more than eight bytes |
//! | [`example`] | example estimate for tests on host and target |
//! | [`node`] | all of it as one participant |
//!
//! Nothing here knows a CAN driver, a clock or a task: frames and times go in, frames come out. A driver's frames are
//! converted by [`Frame::from_can`] and [`Frame::to_can`] from and to any `embedded_can::Frame`. `docs/can.md` is the
//! manual.

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
