//! Processor-in-the-loop (PIL): the estimator on its target processor, fed with samples by a host.
//!
//! | module | duty |
//! |---|---|
//! | [`link`] | messages between host and target, and their frames |
//! | [`server`] | tasks that answer the messages on the target |
#![no_std]
#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

#[cfg(test)]
extern crate std;

mod log;

pub mod link;
pub mod server;
