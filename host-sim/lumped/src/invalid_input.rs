//! The one error that bad input produces: file, line, column, value and the allowed range, as far as they are known.

use std::fmt;
use std::path::{Path, PathBuf};

/// Closed interval of allowed values together with the unit in which it is stated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    /// Smallest allowed value.
    pub min: f64,
    /// Largest allowed value.
    pub max: f64,
    /// Unit as it is printed, for instance `MPa`; empty for a pure number.
    pub unit: &'static str,
}

impl Range {
    /// Range from `min` to `max`, both allowed, in `unit`.
    #[must_use]
    pub const fn new(min: f64, max: f64, unit: &'static str) -> Self {
        Self { min, max, unit }
    }

    /// Whether `value` is a number inside the range; NaN and infinities never are.
    #[must_use]
    pub fn contains(&self, value: f64) -> bool {
        value.is_finite() && value >= self.min && value <= self.max
    }
}

impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let unit = if self.unit.is_empty() { String::new() } else { format!(" {}", self.unit) };
        match (self.min.is_finite(), self.max.is_finite()) {
            (true, true) => write!(f, "{} to {}{unit}", self.min, self.max),
            (true, false) => write!(f, "{}{unit} or more", self.min),
            (false, true) => write!(f, "{}{unit} or less", self.max),
            (false, false) => write!(f, "any number{unit}"),
        }
    }
}

/// Bad input, with the place where it stands. Built up with the `at_`/`with_` methods.
///
/// Printed as `file:line: column NAME: MESSAGE (value V; allowed: R)`; parts that are not known are left out.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub struct InvalidInput {
    /// File that holds the bad input.
    pub file: Option<PathBuf>,
    /// Line in the file, from 1.
    pub line: Option<u64>,
    /// Column name of a table, or the position in the line for free text.
    pub column: Option<String>,
    /// The offending value as it stands in the file.
    pub value: Option<String>,
    /// What would have been allowed.
    pub allowed: Option<String>,
    /// What is wrong, in one sentence without a full stop.
    pub message: String,
}

impl InvalidInput {
    /// Error with a message and no place yet.
    #[must_use]
    pub fn new(message: impl Into<String>) -> Self {
        Self { file: None, line: None, column: None, value: None, allowed: None, message: message.into() }
    }

    /// Names the file; a file already named stays.
    #[must_use]
    pub fn at_file(mut self, file: &Path) -> Self {
        self.file.get_or_insert_with(|| file.to_path_buf());
        self
    }

    /// Names the line, counted from 1.
    #[must_use]
    pub fn at_line(mut self, line: u64) -> Self {
        self.line = Some(line);
        self
    }

    /// Names the column, either by its heading or by its position.
    #[must_use]
    pub fn at_column(mut self, column: impl ToString) -> Self {
        self.column = Some(column.to_string());
        self
    }

    /// Quotes the offending value.
    #[must_use]
    pub fn with_value(mut self, value: impl ToString) -> Self {
        self.value = Some(value.to_string());
        self
    }

    /// States what is allowed.
    #[must_use]
    pub fn with_allowed(mut self, allowed: impl ToString) -> Self {
        self.allowed = Some(allowed.to_string());
        self
    }
}

impl fmt::Display for InvalidInput {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(file) = &self.file {
            write!(f, "{}:", file.display())?;
            if let Some(line) = self.line {
                write!(f, "{line}:")?;
            }
            write!(f, " ")?;
        } else if let Some(line) = self.line {
            write!(f, "line {line}: ")?;
        }
        if let Some(column) = &self.column {
            write!(f, "column {column}: ")?;
        }
        write!(f, "{}", self.message)?;
        match (&self.value, &self.allowed) {
            (Some(value), Some(allowed)) => write!(f, " (value `{value}`; allowed: {allowed})"),
            (Some(value), None) => write!(f, " (value `{value}`)"),
            (None, Some(allowed)) => write!(f, " (allowed: {allowed})"),
            (None, None) => Ok(()),
        }
    }
}
