//! The firmware of the leakage estimator, without a board: link, tasks and what they share.
//!
//! Everything here is written over HAL traits (`embedded-io-async` and the [`tasks::Board`] trait), so a board crate
//! adds pins, clocks, a time driver and an executor, and nothing else. The crate has no heap, no unsafe code and no
//! panic path of its own; it also compiles on the host, where the PC tool speaks the same [`link`] and where the tasks
//! are tested.
//!
//! | module | duty |
//! |---|---|
//! | [`callers`] | who called, from what lies on the stack |
//! | [`controller`] | the tasks of the vehicle's controller: sample, estimate, publish, store, supervise |
//! | [`faults`] | troubles: their codes, and the memory that keeps them |
//! | [`j1939`] | the controller on the CAN bus |
//! | [`link`] | messages between host and firmware and their frames |
//! | [`rig`] | exchange between an emulated controller and its emulated surroundings |
//! | [`sensors`] | conversions and edges into readings, with every failure named |
//! | [`storage`] | records in flash |
//! | [`tasks`] | the asynchronous tasks and the channels between them |
//! | [`update`] | calibration update over CAN |
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
mod outlined_await;

pub mod calibration;
pub mod controller;
pub mod diagnostics;
pub mod j1939;
pub mod sensors;
pub mod storage;
pub mod update;
