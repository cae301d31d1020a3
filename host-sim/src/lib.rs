//! PC tool around the leakage estimator of a pump-motor drive: calibrates it, replays logs through it, validates it.
//!
//! Data flows one way: record, samples, estimator, estimates, report. The estimator is the crate that the firmware links
//! (`kou_estimator`); no equation of it is repeated here. The lumped model of the machine is `kou_lumped`, tables and logs
//! are read by `kou_records`, and bench points become a calibration in `kou_identify`.
//!
//! | module | duty |
//! |---|---|
//! | [`commands`] | one module for each command: arguments, order of work, exit code |
//! | [`replay`] | estimates of a recorded log, with summary and plot |
//! | [`pil`] | processor in the loop: the firmware in QEMU, with samples of a log or around a simulated vehicle |
//! | [`evaluate`] | health monitoring by Monte Carlo on simulated drives |
//! | [`synth`] | synthetic bench tables and drive logs with a known leakage |
//! | [`report`] | the HTML report of a calibration |
//! | [`plots`] | every chart: SVG files, figures of the report, CSV |
//! | [`update`] | calibration updates over CAN from the tool's side |
//! | [`output_file`] | output folders, and errors that name the file |

pub mod commands;
pub mod evaluate;
mod noise;
pub mod output_file;
pub mod pil;
pub mod plots;
pub mod replay;
pub mod report;
pub mod synth;
pub mod update;
