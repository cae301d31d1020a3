//! Calibration in use: which record is active after a start, and for which machine it is valid.
//!
//! | module | duty |
//! |---|---|
//! | [`identity`] | source and checksum of the calibration in use, and the machine that it is for |
//! | [`active`] | selection of the calibration record at start: stored, else default, else none |

pub mod active;
pub mod identity;

pub use active::{LiveCalibration, LoadedCalibration, ParamsSlot, load};
pub use identity::{CalibrationSource, CalibrationState, MachineIdentity};
