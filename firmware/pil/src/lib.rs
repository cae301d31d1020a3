//! Processor-in-the-loop (PIL): runs the estimator on its target processor with samples from a host.
//!
//! A PIL test compiles the controller's algorithm for the real processor, feeds it recorded or simulated samples over
//! a serial link, and compares its results with those of the same code on the host. The host sends a calibration and
//! then samples; the target answers each sample with an estimate. Both ends use the codec of this crate; the tasks of
//! [`server`] run on the target only.
//!
//! | module | duty |
//! |---|---|
//! | [`link`] | messages between host and target, and their frames |
//! | [`server`] | tasks on the target that answer the messages |
//!
//! A request as the host sends it and the target receives it:
//!
//! ```
//! use kou_pil::link::{FrameDecoder, MAX_BODY, MAX_FRAME, Request, decode_request, encode};
//!
//! let mut line = [0; MAX_FRAME];
//! let length = encode::<MAX_BODY>(&Request::Hello, &mut line).unwrap();
//! let mut decoder = FrameDecoder::<MAX_BODY>::new();
//! for &byte in &line[..length] {
//!     if let Some(frame) = decoder.push(byte) {
//!         assert_eq!(frame.and_then(decode_request), Ok(Request::Hello));
//!     }
//! }
//! ```
//!
//! `docs/link.md` describes the link byte by byte.
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
