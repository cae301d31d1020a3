//! Configuration errors and range checks shared by the sensors.

use core::fmt;

use kou_estimator::Problem;

/// Reason for rejecting a sensor's configuration.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ConfigError {
    /// Name of the field.
    pub field: &'static str,
    /// Problem with its value.
    pub problem: Problem,
}

impl fmt::Display for ConfigError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`{}` {}", self.field, self.problem)
    }
}

impl core::error::Error for ConfigError {}

/// Checks for a finite number from `min` to `max`.
pub(super) fn number(field: &'static str, value: f32, min: f32, max: f32) -> Result<(), ConfigError> {
    match Problem::of_number(value, min, max) {
        Some(problem) => Err(ConfigError { field, problem }),
        None => Ok(()),
    }
}

/// Checks for an integer from `min` to `max`.
pub(super) fn integer(field: &'static str, value: u32, min: u32, max: u32) -> Result<(), ConfigError> {
    // Exact for the report's purpose: every limit in use is below 2^24 or a round number.
    number(field, value as f32, min as f32, max as f32)
}

/// Checks a condition between fields.
pub(super) fn consistent(
    field: &'static str,
    holds: bool,
    otherwise: &'static str,
) -> Result<(), ConfigError> {
    if holds { Ok(()) } else { Err(ConfigError { field, problem: Problem::Inconsistent(otherwise) }) }
}
