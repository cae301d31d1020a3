//! Evaluation: how well health is judged, by Monte Carlo on simulated driving.
//!
//! A [`World`] is one machine with one set of sensors: its leakage misses the law by a smooth function of the operating
//! point, its sensors have systematic errors drawn once, and random errors with every sample. [`Drive`] turns it over
//! operating points as a vehicle does. The estimator that judges it is the firmware's. [`Setting`] runs many worlds, with
//! or without something that happens to them ([`faults()`]), and [`Run`] is what came of one.

mod coverage;
mod drive;
mod faults;
mod noise;
mod study;
mod world;

pub use coverage::{DIMENSIONS, Looks, Share, Tally, WINDOW_ENDS_H};
pub use drive::Drive;
pub use faults::{Named, faults};
pub use study::{COMMISSIONING_H, Course, Run, Setting, quantile};
pub use world::{Event, Fault, World};
