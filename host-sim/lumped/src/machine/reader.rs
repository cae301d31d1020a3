//! Reader of the machine file's fields: keys, types, ranges and defaults as [`FIELDS`] states them.

use toml_edit::{Item, TableLike};

use crate::invalid_input::InvalidInput;
use crate::value_range::ValueRange;

use super::fields::{FIELDS, FieldKind, FieldNeed, MachineField};
use super::source::MachineSource;

/// Access to the fields of one file, whose keys and types have been checked.
pub(super) struct FieldReader<'a> {
    source: &'a MachineSource,
}

impl<'a> FieldReader<'a> {
    /// Checks that every key is known and of its type, and that no required one is missing.
    pub(super) fn new(source: &'a MachineSource) -> Result<Self, InvalidInput> {
        let reader = Self { source };
        reader.check_table("", source.root())?;
        reader.check_presence()?;
        Ok(reader)
    }

    /// The file.
    pub(super) fn source(&self) -> &'a MachineSource {
        self.source
    }

    /// Whether the file has a key.
    pub(super) fn has(&self, key: &str) -> bool {
        self.source.item(key).is_some()
    }

    /// Text, where present.
    pub(super) fn text(&self, key: &str) -> Option<&'a str> {
        self.source.item(key)?.as_str()
    }

    /// Number that must be present or has a default, inside the range of its field.
    pub(super) fn number(&self, key: &str) -> Result<f64, InvalidInput> {
        match self.optional(key)? {
            Some(value) => Ok(value),
            None => Err(self.source.error_at(key, "is missing")),
        }
    }

    /// Number inside the range of its field: the file's value, else the default, else none.
    pub(super) fn optional(&self, key: &str) -> Result<Option<f64>, InvalidInput> {
        let default = |field: &MachineField| match field.need {
            FieldNeed::Default(value) => Some(value),
            _ => None,
        };
        let field = described(key);
        let Some(value) = self.written(key) else { return Ok(field.and_then(default)) };
        match field.map(|field| field.kind) {
            Some(FieldKind::Number(range) | FieldKind::Integer(range)) => {
                self.within(key, value, range).map(Some)
            }
            _ => Ok(Some(value)),
        }
    }

    /// Number inside a range that another value of the file determines.
    pub(super) fn bound(&self, key: &str, range: ValueRange) -> Result<f64, InvalidInput> {
        self.within(key, self.number(key)?, range)
    }

    /// Number inside the range of its field and not above `max`; `reason` says why not.
    pub(super) fn at_most(&self, key: &str, max: f64, reason: &str) -> Result<f64, InvalidInput> {
        let value = self.number(key)?;
        if value <= max {
            return Ok(value);
        }
        let error = self.source.error_at(key, reason);
        Err(match described(key).map(|field| field.kind) {
            Some(FieldKind::Number(range)) => error.with_allowed(ValueRange { max, ..range }),
            _ => error,
        })
    }

    /// Keys that the lumped model needs and the file lacks; tables in brackets.
    pub(super) fn missing_for_lumped_model(&self) -> Vec<String> {
        let needed = FIELDS.iter().filter(|field| field.need == FieldNeed::LumpedModel);
        needed
            .flat_map(|field| field.keys().into_iter().map(|key| (key, field.kind)))
            .filter(|(key, _)| !self.has(key))
            .map(|(key, kind)| if kind == FieldKind::Table { format!("[{key}]") } else { key })
            .collect()
    }

    fn written(&self, key: &str) -> Option<f64> {
        let item = self.source.item(key)?;
        item.as_float().or_else(|| item.as_integer().map(|integer| integer as f64))
    }

    fn within(&self, key: &str, value: f64, range: ValueRange) -> Result<f64, InvalidInput> {
        if range.contains(value) {
            return Ok(value);
        }
        Err(self.source.error_at(key, "is out of range").with_value(value).with_allowed(range))
    }

    fn check_table(&self, path: &str, table: &dyn TableLike) -> Result<(), InvalidInput> {
        for (name, item) in table.iter() {
            let key = if path.is_empty() { name.to_string() } else { format!("{path}.{name}") };
            let Some(field) = described(&key) else {
                let known = known_names(path).join(", ");
                return Err(self.source.error_at_key(path, name, "is not known").with_allowed(known));
            };
            let type_error = |wanted: &str| Err(self.source.error_at(&key, format!("must be {wanted}")));
            match field.kind {
                FieldKind::Table => match item.as_table_like() {
                    Some(table) => self.check_table(&key, table)?,
                    None => return type_error("a table"),
                },
                FieldKind::Text if !item.is_str() => return type_error("a text"),
                FieldKind::Integer(_) if !item.is_integer() => return type_error("an integer"),
                FieldKind::Number(_) | FieldKind::BoundByOther { .. } if !is_number(item) => {
                    return type_error("a number");
                }
                _ => {}
            }
        }
        Ok(())
    }

    fn check_presence(&self) -> Result<(), InvalidInput> {
        let required = FIELDS.iter().filter(|field| field.need == FieldNeed::Required);
        for key in required.flat_map(MachineField::keys) {
            let parent = key.rsplit_once('.').map_or("", |(parent, _)| parent);
            if self.source.table(parent).is_some() && !self.has(&key) {
                return Err(self.source.error_at(&key, "is missing"));
            }
        }
        Ok(())
    }
}

fn is_number(item: &Item) -> bool {
    item.is_float() || item.is_integer()
}

/// Description of a dotted key.
fn described(key: &str) -> Option<&'static MachineField> {
    FIELDS.iter().find(|field| field.describes(key))
}

/// Names that a table may hold.
fn known_names(table: &str) -> Vec<String> {
    let keys = FIELDS.iter().flat_map(MachineField::keys);
    keys.filter_map(|key| match key.rsplit_once('.') {
        Some((parent, name)) => (parent == table).then(|| name.to_string()),
        None => table.is_empty().then_some(key),
    })
    .collect()
}
