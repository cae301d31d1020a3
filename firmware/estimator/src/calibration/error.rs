//! Why a calibration is rejected: the field and its problem; the two elementary checks.

use core::fmt;

/// Why a calibration is refused. Names the field as it stands in the TOML form.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CalibrationError {
    /// Dotted name of the field, for instance `oil.bulk_modulus_mpa`.
    pub field: &'static str,
    /// What is wrong with it.
    pub problem: Problem,
}

/// What is wrong with a field.
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
    /// In range by itself, but contradicting another field.
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

pub(crate) fn in_range(field: &'static str, value: f32, min: f32, max: f32) -> Result<(), CalibrationError> {
    if !value.is_finite() {
        Err(CalibrationError { field, problem: Problem::NotFinite })
    } else if value < min || value > max {
        Err(CalibrationError { field, problem: Problem::OutOfRange { value, min, max } })
    } else {
        Ok(())
    }
}

pub(crate) fn consistent(
    field: &'static str,
    holds: bool,
    otherwise: &'static str,
) -> Result<(), CalibrationError> {
    if holds { Ok(()) } else { Err(CalibrationError { field, problem: Problem::Inconsistent(otherwise) }) }
}
