//! Leakage estimator as the application of a vehicle's controller.
//!
//! The crate reads the sensors of a hydrostatic drive, runs the estimator ([`kou_estimator`]) every 10 ms, publishes
//! leakage and wear on the CAN bus (SAE J1939), accepts new calibrations over the same bus, and stores in flash what
//! must survive a power cut. It contains no board code: hardware is reached through traits (`embedded-hal-async`,
//! `embedded-storage-async`, and those of [`controller`]), so a board crate only adds pins, clocks, drivers, a time
//! driver and an executor. The same code runs on the host, where tests move its clock. The crate has no heap, no
//! unsafe code and no panic path of its own.
//!
//! | module | duty |
//! |---|---|
//! | [`sensors`] | conversions and edges to readings, each with a value or a fault |
//! | [`controller`] | the tasks: sample, estimate, publish, storage, supervise |
//! | [`j1939`] | the controller as a node on the CAN bus |
//! | [`diagnostics`] | trouble codes, fault memory, crash records, reset causes |
//! | [`calibration`] | calibration in use: selection at start, identity |
//! | [`update`] | calibration update: protocol, authentication, checks |
//! | [`storage`] | records in flash, each in two copies |
//!
//! Dependencies point one way: `controller` uses every other module; `update` and `calibration` use `storage` and
//! `diagnostics`; only `j1939` and the CAN task of `controller` know CAN frames.
//!
//! Readings of the reference wiring, from an input that no converter serves yet:
//!
//! ```
//! use kou_app::sensors::{SensorInputs, SensorsParams, SensorsState, wiring};
//! use kou_estimator::units::Micros;
//! use kou_estimator::{Fault, Reading};
//!
//! let params = SensorsParams::new(&wiring::REFERENCE).unwrap();
//! let mut sensors = SensorsState::new();
//! sensors.observe(&params, Micros(1000), &SensorInputs::new());
//! let sample = sensors.sample(&params, &Reading::not_fitted());
//! assert_eq!(sample.high_pressure.value, Err(Fault::Missing));
//! ```
//!
//! `docs/firmware.md` draws the tasks and the flow of data.
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
