//! Leakage estimator of an axial-piston pump-motor drive.
//!
//! One call, [`step()`], turns a [`Sample`] of readings into an [`Estimate`]: the external leakage coefficient `Kou` that
//! the calibrated law expects at the present operating point, the coefficient that the measured speed ratio shows, and
//! what both mean for ratio, volumetric efficiency and leakage flow. The same crate runs in the firmware and in the
//! host tool, with the same bits: it uses no floating-point function whose result depends on the machine.
//!
//! * [`Calibration`] is what people and tools write; [`Params`] is what has been checked; [`State`] is what changes.
//! * No heap, no panic path, no unsafe code, bounded time.
//!
//! | module | duty |
//! |---|---|
//! | [`units`] | unit types of the boundary |
//! | [`reading`] | readings, samples and the reasons for missing values |
//! | [`calibration`] | configuration, its checks and its binary record |
//! | [`model::oil_compression`] | compression of the oil (Wylie) |
//! | [`model::flow_balance`] | flow balance: forward model and inverse |
//! | [`model::leakage_law`], [`model::calibrated_region`] | the quadratic law and where it holds |
//! | [`health`] | level of leakage learned while driving, its changes and their causes |
//! | [`record::state`] | what has been learned, as bytes for flash |
//! | [`estimate`] | results and the reasons for their absence |
#![no_std]
#![forbid(unsafe_code)]
#![deny(missing_docs)]
#![cfg_attr(
    not(test),
    deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)
)]

pub mod calibration;
pub mod estimate;
pub mod health;
pub mod model;
mod params;
pub mod reading;
pub mod reason;
pub mod record;
mod standard_error;
mod step;
pub mod units;

pub use calibration::{Calibration, CalibrationError, Problem};
pub use estimate::{Estimate, Expected, Seen};
pub use params::Params;
pub use reading::{Channel, Fault, Reading, Sample};
pub use reason::Reason;
pub use step::{State, step};
