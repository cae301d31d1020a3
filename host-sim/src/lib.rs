//! PC tool around the estimator that runs on the transmission controller.
//!
//! Data flows one way: record -> samples -> estimator -> estimates -> report. The estimator is the very crate that the
//! firmware links; no equation of it stands here.

pub mod commands;
pub mod evaluate;
pub mod pil;
pub mod plots;
pub mod replay;
pub mod report;
pub mod synth;
pub mod update;
