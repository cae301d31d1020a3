//! Error type for invalid input files: file, line, column, value and allowed range, as far as they are known.

use std::fmt;
use std::path::{Path, PathBuf};

/// Closed interval of allowed values, with its unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AllowedRange {
    /// Lower bound.
    pub min: f64,
    /// Upper bound.
    pub max: f64,
    /// Unit as printed, for instance `MPa`; empty for a dimensionless number.
    pub unit: &'static str,
}

impl AllowedRange {
    /// Range from `min` to `max`, both included, in `unit`.
    #[must_use]
    pub const fn new(min: f64, max: f64, unit: &'static str) -> Self {
        Self { min, max, unit }
    }

    /// Whether `value` is finite and inside the range.
    #[must_use]
    pub fn contains(&self, value: f64) -> bool {
        value.is_finite() && value >= self.min && value <= self.max
    }
}

impl fmt::Display for AllowedRange {
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

/// Invalid input with its location. Built with the `at_*` and `with_*` methods.
///
/// `Display` prints `file:line: column NAME: MESSAGE (value V; allowed: R)`; unknown parts are omitted.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub struct InputError {
    /// File with the invalid input.
    pub file: Option<PathBuf>,
    /// Line, counted from 1.
    pub line: Option<u64>,
    /// Column heading of a table, or position in the line of a text file.
    pub column: Option<String>,
    /// Invalid value as written in the file.
    pub value: Option<String>,
    /// Allowed values.
    pub allowed: Option<String>,
    /// Description, one sentence without a full stop.
    pub message: String,
}

impl InputError {
    /// Error with a message and no location.
    #[must_use]
    pub fn new(message: impl Into<String>) -> Self {
        Self { file: None, line: None, column: None, value: None, allowed: None, message: message.into() }
    }

    /// Sets the file, unless one is set already.
    #[must_use]
    pub fn at_file(mut self, file: &Path) -> Self {
        self.file.get_or_insert_with(|| file.to_path_buf());
        self
    }

    /// Sets the line, counted from 1.
    #[must_use]
    pub fn at_line(mut self, line: u64) -> Self {
        self.line = Some(line);
        self
    }

    /// Sets the column, by heading or by position.
    #[must_use]
    pub fn at_column(mut self, column: impl ToString) -> Self {
        self.column = Some(column.to_string());
        self
    }

    /// Sets the invalid value.
    #[must_use]
    pub fn with_value(mut self, value: impl ToString) -> Self {
        self.value = Some(value.to_string());
        self
    }

    /// Sets the allowed values.
    #[must_use]
    pub fn with_allowed(mut self, allowed: impl ToString) -> Self {
        self.allowed = Some(allowed.to_string());
        self
    }
}

impl fmt::Display for InputError {
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
