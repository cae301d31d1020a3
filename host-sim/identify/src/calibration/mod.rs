//! Calibrations on the host: the TOML form for people, and how one is put together from a machine file and a fit.

mod build;
mod toml_form;

pub use build::{SensorClass, Settings, assemble, oil_config, reduced_config};
pub use toml_form::{from_toml, read, read_checked, to_toml, write};
