//! The firmware of the leakage estimator, without a board: link, tasks and what they share.
//!
//! Everything here is written over HAL traits (`embedded-io-async` and the [`tasks::Board`] trait), so a board crate
//! adds pins, clocks, a time driver and an executor, and nothing else. The crate has no heap, no unsafe code and no
//! panic path of its own; it also compiles on the host, where the PC tool speaks the same [`link`] and where the tasks
//! are tested.
//!
//! | module | duty |
//! |---|---|
//! | [`link`] | messages between host and firmware and their frames |
//! | [`tasks`] | the asynchronous tasks and the channels between them |
//!
//! `docs/firmware.md` draws the tasks and the flow of data, `docs/link.md` describes the link byte by byte.
#![no_std]
#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

#[cfg(test)]
extern crate std;

mod log;

pub mod faults;
pub mod j1939;
pub mod link;
pub mod storage;
pub mod tasks;
pub mod update;
