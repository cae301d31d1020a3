//! PC tool around the estimator that runs on the transmission controller.
//!
//! Data flows one way: record -> samples -> estimator -> estimates -> report. The estimator is the very crate that the
//! firmware links; no equation of it stands here.

pub mod input;
pub mod machine;
pub mod full;
