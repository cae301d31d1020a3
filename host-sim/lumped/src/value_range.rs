//! Closed interval of allowed values.

use std::fmt;

/// Closed interval of allowed values with the unit in which it is stated.
#[doc(alias = "interval")]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ValueRange {
    /// Smallest allowed value.
    pub min: f64,
    /// Largest allowed value.
    pub max: f64,
    /// Unit as it is printed, for instance `MPa`; empty for a pure number.
    pub unit: &'static str,
}

impl ValueRange {
    /// Range from `min` to `max`, both allowed, in `unit`.
    #[must_use]
    pub const fn new(min: f64, max: f64, unit: &'static str) -> Self {
        Self { min, max, unit }
    }

    /// Whether `value` lies inside the range; NaN and infinities never do.
    #[must_use]
    pub fn contains(&self, value: f64) -> bool {
        (self.min..=self.max).contains(&value)
    }
}

impl fmt::Display for ValueRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} to {}", self.min, self.max)?;
        if self.unit.is_empty() { Ok(()) } else { write!(f, " {}", self.unit) }
    }
}
