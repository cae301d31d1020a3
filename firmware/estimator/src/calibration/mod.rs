//! Calibration of one machine: configuration and its checks.
//!
//! [`Calibration`] is plain configuration: it can be written, edited and stored, and may be wrong. Only
//! [`crate::Params::new`] turns it into parameters, after checking every field. Its binary record for flash and link is
//! in [`crate::record::calibration`]; the TOML form for people is the host tool's. Field names carry their units in
//! both.

mod configuration;
pub(crate) mod error;
mod health;
pub(crate) mod validate;

pub use configuration::{
    Calibration, Limits, MachineConfig, OutputSensor, Provenance, SensorErrors, SensorRanges,
};
pub use error::{CalibrationError, Problem};
pub use health::HealthConfig;
