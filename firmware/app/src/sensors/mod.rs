//! Sensors of a drive: from conversions and edges to readings, each with a time stamp and a value or a fault.
//!
//! ```text
//! ADC  --counts-->  scale  -->  check  -->  filter  -->  debounce  --\
//!                  (open, short) (range, rate, stuck)                 +--> plausibility --> sample
//! timer --edges-->  pitches (glitch, gap)  -->  speed ----------------/
//! ```
//!
//! | module | duty |
//! |---|---|
//! | [`adc`] | analogue-to-digital conversions, and the MCP3208 driver |
//! | [`scale`] | scaling of counts to pressure, temperature, displacement |
//! | [`analog`] | one analogue channel: checks and filter |
//! | [`pickup`] | shaft speed from a toothed wheel |
//! | [`debounce`] | confirmation and healing of faults |
//! | [`plausibility`] | checks between sensors |
//! | [`set`] | all sensors of a drive |
//! | [`wiring`] | reference wiring |
//!
//! Only [`adc::Mcp3208`] waits or accesses hardware. A configuration is checked once, by the constructor of its
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
