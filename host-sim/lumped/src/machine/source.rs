//! Text of a machine file with the position of every key and value in it.

use std::path::{Path, PathBuf};

use toml_edit::{Document, Item, TableLike, Value};

use crate::invalid_input::{FilePosition, InvalidInput};

/// Largest file that is read; real ones are a few kilobytes.
const MAX_BYTES: u64 = 4 << 20;

/// Parsed TOML text and the file from which it came.
#[derive(Debug)]
pub struct MachineSource {
    path: PathBuf,
    document: Document<String>,
}

impl MachineSource {
    /// Reads a file.
    ///
    /// # Errors
    /// A file that cannot be read, is larger than 4 MiB, is not UTF-8 or is not TOML.
    pub fn read(path: &Path) -> Result<Self, InvalidInput> {
        let unreadable = |e: std::io::Error| {
            InvalidInput::new(format!("cannot be read: {e}")).at(FilePosition::file(path))
        };
        let bytes = std::fs::metadata(path).map_err(unreadable)?.len();
        if bytes > MAX_BYTES {
            return Err(InvalidInput::new("is too large for a machine file")
                .at(FilePosition::file(path))
                .with_value(format!("{bytes} bytes"))
                .with_allowed(format!("at most {MAX_BYTES} bytes")));
        }
        Self::parse(path, std::fs::read_to_string(path).map_err(unreadable)?)
    }

    /// Parses text; `path` serves error messages and the look-up of area tables.
    ///
    /// # Errors
    /// Text that is not TOML, with line and column.
    pub fn parse(path: &Path, text: String) -> Result<Self, InvalidInput> {
        match Document::parse(text.clone()) {
            Ok(document) => Ok(Self { path: path.to_path_buf(), document }),
            Err(e) => {
                let position = e.span().map_or_else(
                    || FilePosition::file(path),
                    |span| position_of_byte(path, &text, span.start),
                );
                Err(InvalidInput::new(e.message().trim_end()).at(position))
            }
        }
    }

    /// Path of the file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Root table.
    #[must_use]
    pub fn root(&self) -> &dyn TableLike {
        self.document.as_table()
    }

    /// Item under a dotted key.
    #[must_use]
    pub fn item(&self, key: &str) -> Option<&Item> {
        let (parent, name) = key.rsplit_once('.').unwrap_or(("", key));
        self.table(parent)?.get(name)
    }

    /// Table under a dotted key; the root under the empty one.
    #[must_use]
    pub fn table(&self, key: &str) -> Option<&dyn TableLike> {
        let mut names = key.split('.').filter(|name| !name.is_empty());
        names.try_fold(self.root(), |table, name| table.get(name)?.as_table_like())
    }

    /// Error about a dotted key: at its value, at the key itself where it holds a table, else at the nearest table.
    #[must_use]
    pub fn error_at(&self, key: &str, message: impl std::fmt::Display) -> InvalidInput {
        let error = InvalidInput::new(format!("`{key}` {message}"));
        match self.item(key) {
            Some(Item::Value(value)) if !matches!(value, Value::InlineTable(_)) => {
                let span = value.span().unwrap_or_default();
                let text = self.document.raw().get(span.clone()).unwrap_or_default();
                error.at(self.position(span.start)).with_value(text)
            }
            Some(item) => error.at(self.position(item.span().unwrap_or_default().start)),
            None => error.at(self.position_of_enclosing_table(key)),
        }
    }

    /// Error about the key of an entry, which may be an unknown one.
    #[must_use]
    pub fn error_at_key(&self, table: &str, name: &str, message: impl std::fmt::Display) -> InvalidInput {
        let found = self.table(table).and_then(|entries| entries.get_key_value(name));
        let start = found.and_then(|(key, item)| Some(key.span().or(item.span())?.start));
        let dotted = if table.is_empty() { name.to_string() } else { format!("{table}.{name}") };
        let position = start.map_or_else(|| FilePosition::file(&self.path), |start| self.position(start));
        InvalidInput::new(format!("`{dotted}` {message}")).at(position)
    }

    fn position_of_enclosing_table(&self, key: &str) -> FilePosition {
        let parent = key.rsplit_once('.').map(|(parent, _)| parent);
        match parent.map(|parent| (parent, self.item(parent).and_then(Item::span))) {
            Some((_, Some(span))) => self.position(span.start),
            Some((parent, None)) => self.position_of_enclosing_table(parent),
            None => FilePosition::file(&self.path),
        }
    }

    fn position(&self, byte: usize) -> FilePosition {
        position_of_byte(&self.path, self.document.raw(), byte)
    }
}

/// Line and character of a byte of the text.
fn position_of_byte(path: &Path, text: &str, byte: usize) -> FilePosition {
    let before = text.get(..byte).unwrap_or(text);
    let line = before.matches('\n').count() + 1;
    let column = before.rsplit('\n').next().unwrap_or_default().chars().count() + 1;
    FilePosition { file: path.to_path_buf(), line: Some(line), column: Some(column.to_string()) }
}

#[cfg(test)]
mod tests {
    use super::MachineSource;
    use std::path::Path;

    const TEXT: &str = "schema = 1\n[pump]\npistons = 9\n  displacement_cm3_per_rev = -3.5\n";

    fn source() -> MachineSource {
        MachineSource::parse(Path::new("m.toml"), TEXT.into()).unwrap()
    }

    #[test]
    fn error_about_a_value_names_line_column_value_and_range() {
        let range = crate::value_range::ValueRange::new(1.0, 2000.0, "cm3/rev");
        let error = source().error_at("pump.displacement_cm3_per_rev", "is out of range").with_allowed(range);
        assert_eq!(
            error.to_string(),
            "m.toml:4: column 30: `pump.displacement_cm3_per_rev` is out of range \
             (value `-3.5`; allowed: 1 to 2000 cm3/rev)"
        );
    }

    #[test]
    fn error_about_an_absent_key_names_the_line_of_its_table() {
        assert_eq!(source().error_at("pump.valve_plate.arc_deg", "is missing").line(), Some(2));
    }

    #[test]
    fn error_about_an_unknown_key_names_the_line_of_the_key() {
        assert_eq!(source().error_at_key("pump", "pistons", "is unknown").line(), Some(3));
    }

    #[test]
    fn broken_toml_names_line_and_column() {
        let error = MachineSource::parse(Path::new("m.toml"), "a = 1\nb = = 2\n".into()).unwrap_err();
        let column = error.position.as_ref().and_then(|position| position.column.as_deref());
        assert_eq!((error.line(), column), (Some(2), Some("5")));
    }
}
