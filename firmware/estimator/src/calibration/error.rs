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

impl Problem {
    /// Problem of a value that must be finite and within `min` to `max`; `None` for a valid one.
    #[must_use]
    pub fn of_number(value: f32, min: f32, max: f32) -> Option<Self> {
        if !value.is_finite() {
            Some(Self::NotFinite)
        } else if value < min || value > max {
            Some(Self::OutOfRange { value, min, max })
        } else {
            None
        }
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotFinite => f.write_str("is not a finite number"),
            Self::OutOfRange { value, min, max } => write!(f, "is {value}; allowed: {min} to {max}"),
            Self::Inconsistent(reason) => write!(f, "is inconsistent: {reason}"),
        }
    }
}

impl fmt::Display for CalibrationError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`{}` {}", self.field, self.problem)
    }
}

impl core::error::Error for CalibrationError {}

/// Rejects a value that is not finite or out of range.
pub(crate) fn in_range(field: &'static str, value: f32, min: f32, max: f32) -> Result<(), CalibrationError> {
    match Problem::of_number(value, min, max) {
        Some(problem) => Err(CalibrationError { field, problem }),
        None => Ok(()),
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
