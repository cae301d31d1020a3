//! TOML files with located errors: unknown keys are rejected, and a later check can name line and column of any key.

use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use toml_edit::{Document, Item, TableLike};

use crate::input_error::{AllowedRange, InputError};

/// Size limit of a TOML file; real ones have a few kilobytes.
const MAX_BYTES: u64 = 4 << 20;

/// Parsed TOML file with the position of every key.
#[derive(Debug, Clone)]
pub struct TomlFile {
    path: PathBuf,
    text: String,
    document: Document<String>,
}

impl TomlFile {
    /// Reads and parses the file.
    ///
    /// # Errors
    /// When the file cannot be read, is larger than 4 MiB, is not UTF-8 or is not TOML; the last with line and column.
    pub fn read(path: &Path) -> Result<Self, InputError> {
        let fail = |what: String| InputError::new(what).at_file(path);
        let size = std::fs::metadata(path).map_err(|e| fail(format!("cannot be read: {e}")))?.len();
        if size > MAX_BYTES {
            return Err(fail("is too large for a TOML file".into())
                .with_value(format!("{size} bytes"))
                .with_allowed(format!("at most {MAX_BYTES} bytes")));
        }
        let text = std::fs::read_to_string(path).map_err(|e| fail(format!("cannot be read: {e}")))?;
        Self::from_text(path, text)
    }

    /// Parses `text`; `path` is used for error messages only.
    ///
    /// # Errors
    /// When the text is not TOML, with line and column.
    pub fn from_text(path: &Path, text: String) -> Result<Self, InputError> {
        let document = Document::parse(text.clone())
            .map_err(|e| located(InputError::new(e.message().to_string()).at_file(path), &text, e.span()))?;
        Ok(Self { path: path.to_path_buf(), text, document })
    }

    /// Path of the file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Text of the file.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Deserialises the whole file.
    ///
    /// # Errors
    /// Missing, unknown or wrongly typed keys, with line and column.
    pub fn parse<T: DeserializeOwned>(&self) -> Result<T, InputError> {
        toml::from_str(&self.text).map_err(|e| {
            let error = InputError::new(e.message().trim_end().to_string()).at_file(&self.path);
            located(error, &self.text, e.span())
        })
    }

    /// The file with the key `synonym` of the dotted `table` (empty for the top level) spelled `key`, padded with spaces so
    /// that every other position stays; unchanged where the synonym is absent or shorter than the key.
    ///
    /// # Errors
    /// When both spellings are present, with line and column.
    pub(crate) fn with_spelling(self, table: &str, synonym: &str, key: &str) -> Result<Self, InputError> {
        let mut parent: &dyn TableLike = self.document.as_table();
        for part in table.split('.').filter(|part| !part.is_empty()) {
            let Some(child) = parent.get(part).and_then(Item::as_table_like) else { return Ok(self) };
            parent = child;
        }
        let Some(span) = parent.get_key_value(synonym).and_then(|(found, _)| found.span()) else {
            return Ok(self);
        };
        if parent.contains_key(key) {
            let error = InputError::new(format!("`{synonym}` and `{key}` are the same key; state it once"));
            return Err(located(error.at_file(&self.path), &self.text, Some(span)));
        }
        let padded = format!("{key:<width$}", width = span.len());
        let mut text = self.text;
        text.replace_range(span, &padded);
        Self::from_text(&self.path, text)
    }

    /// Error about the value of the dotted `key` (for instance `pump.displacement_cm3_per_rev`), with line and column of the
    /// value, or of the nearest enclosing table when the key is absent.
    #[must_use]
    pub fn error_at(&self, key: &str, message: impl Into<String>) -> InputError {
        let error = InputError::new(format!("`{key}` {}", message.into())).at_file(&self.path);
        match self.find(key) {
            Some((offset, value)) => {
                let (line, column) = line_and_column(&self.text, offset);
                let error = error.at_line(line).at_column(column);
                if value.is_empty() { error } else { error.with_value(value) }
            }
            None => error,
        }
    }

    /// Checks that the value of the dotted `key` is in `range`.
    ///
    /// # Errors
    /// A value out of range or not finite, with line, column, value and range.
    pub fn check(&self, key: &str, value: f64, range: AllowedRange) -> Result<f64, InputError> {
        if range.contains(value) {
            Ok(value)
        } else {
            Err(self.error_at(key, "is out of range").with_value(value).with_allowed(range))
        }
    }

    /// Byte offset and text of the value of `key`; offset of the nearest enclosing table when it is absent.
    fn find(&self, key: &str) -> Option<(usize, String)> {
        let mut table: &dyn TableLike = self.document.as_table();
        let mut nearest = None;
        let mut parts = key.split('.').peekable();
        while let Some(part) = parts.next() {
            let Some(item) = table.get(part) else { return nearest };
            if parts.peek().is_none() {
                let span = item.span()?;
                let value = match item {
                    Item::Value(_) => self.text.get(span.clone()).unwrap_or_default().to_string(),
                    _ => String::new(),
                };
                return Some((span.start, value));
            }
            if let Some(span) = item.span() {
                nearest = Some((span.start, String::new()));
            }
            table = item.as_table_like()?;
        }
        nearest
    }
}

/// Adds line and column of a parse error, where the parser states them.
fn located(error: InputError, text: &str, span: Option<std::ops::Range<usize>>) -> InputError {
    match span {
        Some(span) => {
            let (line, column) = line_and_column(text, span.start);
            error.at_line(line).at_column(column)
        }
        None => error,
    }
}

/// Line and column, both from 1, of the byte at `offset`.
fn line_and_column(text: &str, offset: usize) -> (u64, u64) {
    let before = text.as_bytes().get(..offset.min(text.len())).unwrap_or_default();
    let line = 1 + before.iter().filter(|&&b| b == b'\n').count() as u64;
    let start = before.iter().rposition(|&b| b == b'\n').map_or(0, |i| i + 1);
    let column = 1 + String::from_utf8_lossy(before.get(start..).unwrap_or_default()).chars().count() as u64;
    (line, column)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "schema = 1\n[pump]\npistons = 9\n  displacement_cm3_per_rev = -3.5\n";

    fn file() -> TomlFile {
        TomlFile::from_text(Path::new("m.toml"), TEXT.into()).unwrap()
    }

    #[test]
    fn range_error_names_line_column_value_and_range() {
        let range = AllowedRange::new(1.0, 2000.0, "cm3/rev");
        let text = file().check("pump.displacement_cm3_per_rev", -3.5, range).unwrap_err().to_string();
        assert_eq!(
            text,
            "m.toml:4: column 30: `pump.displacement_cm3_per_rev` is out of range \
             (value `-3.5`; allowed: 1 to 2000 cm3/rev)"
        );
    }

    #[test]
    fn absent_key_is_located_at_its_table() {
        let error = file().error_at("pump.valve_plate.arc_deg", "is missing");
        assert_eq!(error.line, Some(2));
    }

    #[test]
    fn broken_toml_names_line_and_column() {
        let error = TomlFile::from_text(Path::new("m.toml"), "a = 1\nb = = 2\n".into()).unwrap_err();
        assert_eq!((error.line, error.column.as_deref()), (Some(2), Some("5")));
    }
}
