//! Error for a value that the model cannot work with: position in its file, value and allowed range.

use std::fmt;
use std::path::{Path, PathBuf};

use crate::value_range::ValueRange;

/// Position in an input file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FilePosition {
    /// File as it was named by the caller.
    pub file: PathBuf,
    /// Line, from 1; absent for an error about the entire file.
    pub line: Option<usize>,
    /// Column of a table by its heading, or the character in the line, from 1.
    pub column: Option<String>,
}

impl FilePosition {
    /// Position of the entire file.
    #[must_use]
    pub fn file(path: &Path) -> Self {
        Self { file: path.to_path_buf(), line: None, column: None }
    }
}

impl fmt::Display for FilePosition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:", self.file.display())?;
        if let Some(line) = self.line {
            write!(f, "{line}:")?;
        }
        self.column.iter().try_for_each(|column| write!(f, " column {column}:"))
    }
}

/// Invalid value in a machine file, an area table or an operating point.
///
/// Printed as `FILE:LINE: column NAME: MESSAGE (value V; allowed: R)` without the parts that are unknown.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub struct InvalidInput {
    /// Place of the value; absent for values that no file holds.
    pub position: Option<FilePosition>,
    /// Message, one sentence without a full stop.
    pub message: String,
    /// The value as written.
    pub value: Option<String>,
    /// Allowed values.
    pub allowed: Option<String>,
}

impl InvalidInput {
    /// Error with a message only.
    #[must_use]
    pub fn new(message: impl Into<String>) -> Self {
        Self { position: None, message: message.into(), value: None, allowed: None }
    }

    /// Error about a quantity outside its range.
    #[must_use]
    pub fn out_of_range(quantity: &str, value: f64, range: ValueRange) -> Self {
        Self::new(format!("{quantity} is out of range")).with_value(value).with_allowed(range)
    }

    /// Adds the position.
    #[must_use]
    pub fn at(self, position: FilePosition) -> Self {
        Self { position: Some(position), ..self }
    }

    /// Adds the value.
    #[must_use]
    pub fn with_value(self, value: impl ToString) -> Self {
        Self { value: Some(value.to_string()), ..self }
    }

    /// Adds the allowed values.
    #[must_use]
    pub fn with_allowed(self, allowed: impl ToString) -> Self {
        Self { allowed: Some(allowed.to_string()), ..self }
    }

    /// Line of the position, where there is one.
    #[must_use]
    pub fn line(&self) -> Option<usize> {
        self.position.as_ref()?.line
    }
}

impl fmt::Display for InvalidInput {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(position) = &self.position {
            write!(f, "{position} ")?;
        }
        f.write_str(&self.message)?;
        let value = self.value.iter().map(|value| format!("value `{value}`"));
        let allowed = self.allowed.iter().map(|allowed| format!("allowed: {allowed}"));
        let details: Vec<String> = value.chain(allowed).collect();
        if details.is_empty() { Ok(()) } else { write!(f, " ({})", details.join("; ")) }
    }
}
