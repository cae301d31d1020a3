//! Sensors of a drive: from conversions and edges to readings, each a time stamp plus a value or a reason.
//!
//! ```text
//! ADC  --counts-->  scale  -->  judge  -->  filter  -->  debounce  --\
//!                  (open, short) (range, rate, stuck)                 +--> plausibility --> sample
//! timer --edges-->  pitches (glitch, gap)  -->  speed ----------------/
//! ```
//!
//! | module | duty |
//! |---|---|
//! | [`adc`] | conversions, and the MCP3208's driver |
//! | [`scale`] | counts to pressure, temperature, displacement |
//! | [`analog`] | one analogue channel: checks and filter |
//! | [`pickup`] | shaft speed from a toothed wheel |
//! | [`debounce`] | when a failure is believed, and when forgiven |
//! | [`plausibility`] | what the sensors say of each other |
//! | [`set`] | all of a drive's sensors together |
//! | [`wiring`] | the reference wiring |
//!
//! Nothing here waits or touches hardware but [`adc::Mcp3208`]. A configuration is checked once, by the constructor of its
//! `...Params`; a `...State` holds what changes.

pub mod adc;
pub mod analog;
mod config;
pub mod debounce;
pub mod pickup;
pub mod plausibility;
pub mod scale;
pub mod set;
#[cfg(test)]
mod tests;
mod unit;
pub mod wiring;

pub use config::ConfigError;
pub use set::{SensorInputs, SensorsConfig, SensorsParams, SensorsState};
pub use unit::SensorUnit;
