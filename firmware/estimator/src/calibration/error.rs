//! Error of a calibration: the rejected field and its problem; the elementary checks.

use core::fmt;

/// Error of a calibration, with the field as named in the TOML form.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CalibrationError {
    /// Dotted name of the field, for instance `oil.bulk_modulus_mpa`.
    pub field: &'static str,
    /// Problem of its value.
    pub problem: Problem,
}

/// Problem of a field.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Problem {
    /// NaN or infinite.
    NotFinite,
    /// Outside the allowed range.
    OutOfRange {
        /// The value.
        value: f32,
        /// Smallest allowed value.
        min: f32,
        /// Largest allowed value.
        max: f32,
    },
    /// In range by itself, but inconsistent with another field.
    Inconsistent(&'static str),
}

impl fmt::Display for CalibrationError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.problem {
            Problem::NotFinite => write!(f, "`{}` is not a finite number", self.field),
            Problem::OutOfRange { value, min, max } => {
                write!(f, "`{}` is {value}; allowed: {min} to {max}", self.field)
            }
            Problem::Inconsistent(why) => write!(f, "`{}` is inconsistent: {why}", self.field),
        }
    }
}

impl core::error::Error for CalibrationError {}

/// Rejects a value that is not finite or out of range.
pub(crate) fn in_range(field: &'static str, value: f32, min: f32, max: f32) -> Result<(), CalibrationError> {
    if !value.is_finite() {
        Err(CalibrationError { field, problem: Problem::NotFinite })
    } else if value < min || value > max {
        Err(CalibrationError { field, problem: Problem::OutOfRange { value, min, max } })
    } else {
        Ok(())
    }
}

/// Rejects a field for which a condition does not hold.
pub(crate) fn consistent(
    field: &'static str,
    condition: bool,
    problem: &'static str,
) -> Result<(), CalibrationError> {
    if condition { Ok(()) } else { Err(CalibrationError { field, problem: Problem::Inconsistent(problem) }) }
}
