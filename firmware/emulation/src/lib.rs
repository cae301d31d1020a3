//! Emulated surroundings of the controller, for boards in an emulator and for tests on the host.
//!
//! | module | duty |
//! |---|---|
//! | [`exchange`] | messages between an emulated controller and the host that emulates its hardware |
//! | [`ram_flash`] | NOR flash in RAM that can lose its supply in the middle of an operation |
//! | [`provisioning`] | writer of the production page |
//! | [`examples`] | computed examples that tests compare between host and target |
//!
//! No board on a vehicle links this crate.
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
