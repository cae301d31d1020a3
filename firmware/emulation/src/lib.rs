//! Emulated hardware of the controller, for boards in an emulator and for tests on the host.
//!
//! The application ([`kou_app`]) is written over hardware traits, so the same code runs on a vehicle, in an emulator
//! and in host tests. This crate supplies what the emulated variants have in common: the messages by which an
//! emulated board asks the host for its sensors, CAN bus and flash, and a flash in RAM whose power can fail at any
//! byte. No board on a vehicle links it.
//!
//! | module | duty |
//! |---|---|
//! | [`exchange`] | messages between an emulated controller and the host that emulates its hardware |
//! | [`ram_flash`] | NOR flash in RAM with simulated power failures |
//! | [`provisioning`] | writer of the production page |
//! | [`examples`] | computed examples that tests compare between host and target |
//!
//! A message survives the exchange:
//!
//! ```
//! use kou_emulation::{FirmwareMessage, FlashWork, MAX_LEN, pack, unpack};
//!
//! let message = FirmwareMessage::Flash { of: None, work: FlashWork::Read { offset: 0, length: 16 } };
//! let mut buffer = [0; MAX_LEN];
//! let bytes = pack(&message, &mut buffer).unwrap();
//! let (received, used) = unpack::<FirmwareMessage>(bytes).unwrap();
//! assert_eq!((received, used), (message, bytes.len()));
//! ```
#![no_std]
#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

#[cfg(test)]
extern crate std;

pub mod examples;
pub mod exchange;
pub mod provisioning;
pub mod ram_flash;

pub use exchange::*;
pub use ram_flash::RamFlash;
