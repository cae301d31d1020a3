//! Estimates leakage and wear of a hydrostatic drive (axial-piston pump and motor) from its controller's own signals.
//!
//! The external leakage of a drive cannot be measured in service; it is inferred from the speed ratio: of what the pump
//! delivers, the motor is short by compression, which is computed, and by leakage, which is the unknown. Leakage is
//! stated as the coefficient `Kou` of one piston chamber in (L/min)/MPa (Wang et al. 2025, doi
//! 10.1177/16878132251383370).
//!
//! One call, [`step()`], turns a [`Sample`] of sensor readings into an [`Estimate`] with three parts:
//!
//! * [`Expected`]: leakage of the new machine at the present operating point, by the calibrated leakage law;
//! * [`Observed`]: leakage that explains the measured speed ratio, by the inverse of the flow balance;
//! * [`Health`](health::Health): level of leakage learned while driving, detected changes and their possible causes.
//!
//! Each of the first two is a `Result`: valid with a standard error, or the [`Reason`] why not.
//!
//! ```
//! use kou_estimator::units::{Celsius, Megapascal, Micros, RevPerMin};
//! use kou_estimator::{Calibration, CalibrationError, Estimate, Params, Reading, Sample, State, step};
//!
//! /// Estimate from one set of readings; `params` and `state` live as long as the drive runs.
//! fn on_sample(params: &Params, state: &mut State, time: Micros) -> Estimate {
//!     let sample = Sample {
//!         pump_speed: Reading::new(time, RevPerMin(1500.0)),
//!         motor_speed: Reading::new(time, RevPerMin(1400.0)),
//!         high_pressure: Reading::new(time, Megapascal(25.0)),
//!         oil_temperature: Reading::new(time, Celsius(50.0)),
//!         ..Sample::empty(time)
//!     };
//!     step(params, state, &sample)
//! }
//!
//! fn run(calibration: &Calibration) -> Result<(), CalibrationError> {
//!     let params = Params::new(calibration)?; // every field is validated here
//!     let mut state = State::new();
//!     let estimate = on_sample(&params, &mut state, Micros(10_000));
//!     match estimate.wear_ratio() {
//!         Ok(wear) => println!("leaks {} times as much as when new", wear.get()),
//!         Err(reason) => println!("no estimate: {}", reason.name()),
//!     }
//!     Ok(())
//! }
//! ```
//!
//! [`Calibration`] is configuration, written by a tool and possibly wrong; [`Params`] is a calibration that has passed
//! all checks; [`State`] is everything that changes. The crate runs on a microcontroller and in the host tool with the
//! same bits: it has no heap, no panic path, no unsafe code, bounded execution time, and uses no floating-point
//! function whose result depends on the machine. `#![no_std]` means that it needs nothing of an operating system.
//!
//! | module | content | imports |
//! |---|---|---|
//! | [`units`] | unit types of the interface | |
//! | [`model`] | equations: oil compression, flow balance, leakage law, calibrated region | `units` |
//! | [`reading`], [`reason`] | readings, faults, reasons for missing results | `units`, `model` |
//! | [`calibration`] | configuration of one machine and its validation | `model` |
//! | [`health`] | recursive estimation, change detection, diagnosis, prognosis | `model`, `calibration`, `reason` |
//! | [`estimate`] | result of a step | `reason`, `health` |
//! | `params`, `standard_error`, `step` | checked parameters, error propagation, the step | all above |
//! | [`record`] | calibration and state as bytes | `calibration`, `step` |
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
pub use estimate::{Estimate, Expected, Observed};
pub use params::Params;
pub use reading::{Channel, Fault, Reading, Sample};
pub use reason::Reason;
pub use step::{State, step};
