//! TOML files that people edit: parsed with unknown keys refused, and every later complaint led back to its line.

use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use toml_edit::{Document, Item, TableLike};

use super::{InvalidInput, Range};

/// Largest TOML file that is read; real ones are a few kilobytes.
const MAX_BYTES: u64 = 4 << 20;

/// A TOML file in memory, able to say where each of its keys stands.
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
    pub fn read(path: &Path) -> Result<Self, InvalidInput> {
        let fail = |what: String| InvalidInput::new(what).at_file(path);
        let size = std::fs::metadata(path).map_err(|e| fail(format!("cannot be read: {e}")))?.len();
        if size > MAX_BYTES {
            return Err(fail("is too large for a TOML file".into())
                .with_value(format!("{size} bytes"))
                .with_allowed(format!("at most {MAX_BYTES} bytes")));
        }
        let text = std::fs::read_to_string(path).map_err(|e| fail(format!("cannot be read: {e}")))?;
        Self::from_text(path, text)
    }

    /// Parses `text` as if it had been read from `path`.
    ///
    /// # Errors
    /// When the text is not TOML, with line and column.
    pub fn from_text(path: &Path, text: String) -> Result<Self, InvalidInput> {
        let document = Document::parse(text.clone()).map_err(|e| {
            let error = InvalidInput::new(e.message().to_string()).at_file(path);
            match e.span() {
                Some(span) => {
                    let (line, column) = line_and_column(&text, span.start);
                    error.at_line(line).at_column(column)
                }
                None => error,
            }
        })?;
        Ok(Self { path: path.to_path_buf(), text, document })
    }

    /// Path from which the file was read.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The file's text.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Deserialises the whole file.
    ///
    /// # Errors
    /// Missing, unknown or wrongly typed keys, with line and column.
    pub fn parse<T: DeserializeOwned>(&self) -> Result<T, InvalidInput> {
        toml::from_str(&self.text).map_err(|e| {
            let error = InvalidInput::new(e.message().trim_end().to_string()).at_file(&self.path);
            match e.span() {
                Some(span) => {
                    let (line, column) = line_and_column(&self.text, span.start);
                    error.at_line(line).at_column(column)
                }
                None => error,
            }
        })
    }

    /// Error about the value under the dotted `key` (for instance `pump.displacement_cm3_per_rev`), with the line and
    /// column at which it stands, or those of the nearest table that exists when the key itself is absent.
    #[must_use]
    pub fn error_at(&self, key: &str, message: impl Into<String>) -> InvalidInput {
        let error = InvalidInput::new(format!("`{key}` {}", message.into())).at_file(&self.path);
        match self.find(key) {
            Some((offset, value)) => {
                let (line, column) = line_and_column(&self.text, offset);
                let error = error.at_line(line).at_column(column);
                if value.is_empty() { error } else { error.with_value(value) }
            }
            None => error,
        }
    }

    /// Checks that the number under the dotted `key` lies in `range`.
    ///
    /// # Errors
    /// When it does not, or is not a number, naming line, column, value and range.
    pub fn check(&self, key: &str, value: f64, range: Range) -> Result<f64, InvalidInput> {
        if range.contains(value) {
            Ok(value)
        } else {
            Err(self.error_at(key, "is out of range").with_value(value).with_allowed(range))
        }
    }

    /// Byte offset and text of the value under `key`; offset of the nearest enclosing table when it is absent.
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
        let range = Range::new(1.0, 2000.0, "cm3/rev");
        let text = file().check("pump.displacement_cm3_per_rev", -3.5, range).unwrap_err().to_string();
        assert_eq!(
            text,
            "m.toml:4: column 30: `pump.displacement_cm3_per_rev` is out of range \
             (value `-3.5`; allowed: 1 to 2000 cm3/rev)"
        );
    }

    #[test]
    fn absent_key_is_led_to_its_table() {
        let error = file().error_at("pump.valve_plate.arc_deg", "is missing");
        assert_eq!(error.line, Some(2));
    }

    #[test]
    fn broken_toml_names_line_and_column() {
        let error = TomlFile::from_text(Path::new("m.toml"), "a = 1\nb = = 2\n".into()).unwrap_err();
        assert_eq!((error.line, error.column.as_deref()), (Some(2), Some("5")));
    }
}
