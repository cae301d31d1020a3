//! Evaluation: how well health is judged, by Monte Carlo on simulated driving.
//!
//! A [`SimulatedDrive`] is one machine with one set of sensors: its leakage misses the law by a smooth function of the operating
//! point, its sensors have systematic errors drawn once, and random errors with every sample. [`DutyCycle`] turns it over
//! operating points as a vehicle does. The estimator that judges it is the firmware's. [`TrialSettings`] runs many drives, with
//! or without something that happens to them ([`fault_cases()`]), and [`TrialResult`] is what came of one.

mod coverage;
mod duty_cycle;
mod faults;
mod noise;
mod simulated_drive;
mod trial;

pub use coverage::{CoverageCounts, CoverageShare, DIMENSIONS, HitCount, WINDOW_ENDS_H};
pub use duty_cycle::DutyCycle;
pub use faults::{FaultCase, fault_cases};
pub use simulated_drive::{DriveEvent, SensorOffset, SimulatedDrive};
pub use trial::{COMMISSIONING_H, TrialCase, TrialResult, TrialSettings, quantile};
