//! Commands of `host-sim`, one module each.
//!
//! | module | duty |
//! |---|---|
//! | `identify`, `report` | bench points to a calibration; the page that documents it |
//! | `replay`, `pil` | a log through the estimator on this computer, or through the firmware in QEMU |
//! | `verify`, `evaluate` | the calibrated estimator against the lumped model; health monitoring by Monte Carlo |
//! | `simulate`, `step`, `paper` | the lumped model: a steady point, a step response, the figures of the paper |
//! | `synth` | synthetic bench tables and drive logs |
//! | `dbc`, `update`, `provision` | files for the controller: CAN database, calibration update, provisioning page |
//! | `bench_args`, `calibrated_args`, `class_arg`, `point_args` | arguments that several commands share |
//! | `failure`, `output` | exit codes; terminal output |

pub mod bench_args;
pub mod calibrated_args;
pub mod class_arg;
pub mod dbc;
pub mod evaluate;
pub mod failure;
pub mod identify;
mod output;
pub mod paper;
pub mod pil;
pub mod point_args;
pub mod provision;
pub mod replay;
pub mod report;
pub mod simulate;
pub mod step;
pub mod synth;
pub mod update;
pub mod verify;

pub use failure::Failure;
