//! Evaluation: how well health is judged, by Monte Carlo on simulated driving.
//!
//! A [`World`] is one machine with one set of sensors: its leakage misses the law by a smooth function of the operating
//! point, its sensors have systematic errors drawn once, and random errors with every sample. [`Drive`] turns it over
//! operating points as a vehicle does. The estimator that judges it is the firmware's.

mod drive;
mod noise;
mod study;
mod world;

pub use drive::Drive;
pub use study::{COMMISSIONING_H, Run, Setting, quantile};
pub use world::{Event, Fault, World};
