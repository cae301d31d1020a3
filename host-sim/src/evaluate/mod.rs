//! Evaluation of health monitoring by Monte Carlo simulation.
//!
//! A [`SimulatedDrive`] is one machine with one set of sensors: its leakage deviates from the law by a smooth function of the
//! operating point, its sensors have systematic errors drawn once, and random errors with every sample. A [`DutyCycle`] moves
//! it over operating points as a vehicle does. The estimator under test is the firmware's. [`TrialSettings`] runs many drives,
//! healthy or with a scheduled event ([`TrialCase`], [`fault_cases()`]); each gives a [`TrialResult`].

mod coverage;
mod duty_cycle;
mod faults;
mod simulated_drive;
mod trial;

pub use coverage::{CoverageCounts, CoverageShare, DIMENSIONS, HitCount, WINDOW_ENDS_H};
pub use duty_cycle::DutyCycle;
pub use faults::{FaultCase, fault_cases};
pub use simulated_drive::{DriveEvent, SensorOffset, SimulatedDrive};
pub use trial::{COMMISSIONING_H, TrialCase, TrialResult, TrialSettings, quantile};
