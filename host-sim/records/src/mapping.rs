//! Mapping files (TOML): columns, units and row filters of a foreign CSV table. Format: `docs/files.md`.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;

use crate::input_error::InputError;
use crate::quantity::{MeasuredQuantity, UnitConversion};
use crate::toml_file::TomlFile;

/// Supported schema of mapping files.
const SCHEMA: u32 = 1;

/// Source of a quantity.
#[derive(Debug, Clone, PartialEq)]
pub enum ColumnSource {
    /// Column of the file, with its unit conversion.
    Column(String, UnitConversion),
    /// Constant value for all rows.
    Constant(f64),
}

/// Condition for reading a row.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RowFilter {
    /// Column of the file that is compared.
    pub column: String,
    /// Divisor: the value modulo this number is compared.
    #[serde(default)]
    pub modulo: Option<f64>,
    /// Closed intervals; the value must be in one of them.
    pub ranges: Vec<[f64; 2]>,
}

impl RowFilter {
    /// Whether a row with this value is read; never for NaN.
    #[must_use]
    pub fn matches(&self, value: f64) -> bool {
        let value = match self.modulo {
            Some(modulo) => value.rem_euclid(modulo),
            None => value,
        };
        self.ranges.iter().any(|[low, high]| value >= *low && value <= *high)
    }
}

/// Validated mapping from the columns of a file to measured quantities.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Mapping {
    /// Sources of the mapped quantities; the others are read from the columns with the default names.
    pub sources: BTreeMap<MeasuredQuantity, ColumnSource>,
    /// Texts that mark a missing reading.
    pub missing: Vec<String>,
    /// Delimiter; detected from the heading when absent.
    pub delimiter: Option<u8>,
    /// Whether numbers have a decimal comma.
    pub decimal_comma: bool,
    /// Row filters; a row must match all of them.
    pub select: Vec<RowFilter>,
    /// Columns copied to the output.
    pub carry: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MappingToml {
    schema: u32,
    #[serde(default)]
    columns: BTreeMap<String, ColumnToml>,
    #[serde(default)]
    constants: BTreeMap<String, f64>,
    #[serde(default)]
    missing: Vec<String>,
    delimiter: Option<String>,
    decimal: Option<String>,
    #[serde(default)]
    select: Vec<RowFilter>,
    #[serde(default)]
    carry: Vec<String>,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum ColumnToml {
    Name(String),
    Detailed(DetailedColumnToml),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct DetailedColumnToml {
    from: String,
    unit: Option<String>,
    #[serde(default = "one")]
    scale: f64,
    #[serde(default)]
    offset: f64,
}

const fn one() -> f64 {
    1.0
}

impl Mapping {
    /// Reads and checks a mapping file.
    ///
    /// # Errors
    /// Unknown keys, quantities or units and invalid values, with line and column.
    pub fn read(path: &Path) -> Result<Self, InputError> {
        Self::from_toml(&TomlFile::read(path)?)
    }

    /// Checks a mapping that is already in memory.
    ///
    /// # Errors
    /// As [`Mapping::read`].
    pub fn from_toml(file: &TomlFile) -> Result<Self, InputError> {
        let raw: MappingToml = file.parse()?;
        if raw.schema != SCHEMA {
            return Err(file.error_at("schema", "is not supported by this version").with_allowed(SCHEMA));
        }
        let mut sources = BTreeMap::new();
        for (name, column) in raw.columns {
            let key = format!("columns.{name}");
            let quantity = quantity(file, &key, &name)?;
            let source = match column {
                ColumnToml::Name(from) => ColumnSource::Column(from, UnitConversion::NONE),
                ColumnToml::Detailed(column) => {
                    ColumnSource::Column(column.from.clone(), conversion(file, &key, quantity, &column)?)
                }
            };
            sources.insert(quantity, source);
        }
        for (name, value) in raw.constants {
            let key = format!("constants.{name}");
            let quantity = quantity(file, &key, &name)?;
            file.check(&key, value, quantity.bench_range())?;
            if sources.insert(quantity, ColumnSource::Constant(value)).is_some() {
                return Err(file.error_at(&key, "is mapped to a column as well; remove one of the two"));
            }
        }
        for (i, select) in raw.select.iter().enumerate() {
            let bad_modulo = select.modulo.is_some_and(|m| !(m.is_finite() && m > 0.0));
            let bad_range = select.ranges.is_empty()
                || select.ranges.iter().any(|[low, high]| low > high || low.is_nan() || high.is_nan());
            if bad_modulo || bad_range {
                let what = format!("entry {} for column `{}` selects nothing", i + 1, select.column);
                return Err(file
                    .error_at("select", what)
                    .with_allowed("ranges = [[low, high], ...] with low <= high; modulo > 0"));
            }
        }
        let delimiter = match raw.delimiter.as_deref() {
            None => None,
            Some(text) => match text.as_bytes() {
                [byte] => Some(*byte),
                _ => {
                    return Err(file
                        .error_at("delimiter", "is not one character")
                        .with_allowed("one of , ; or a tab"));
                }
            },
        };
        let decimal_comma = match raw.decimal.as_deref() {
            None | Some(".") => false,
            Some(",") => true,
            Some(_) => {
                return Err(file
                    .error_at("decimal", "is neither a point nor a comma")
                    .with_allowed("\".\" or \",\""));
            }
        };
        Ok(Self {
            sources,
            missing: raw.missing,
            delimiter,
            decimal_comma,
            select: raw.select,
            carry: raw.carry,
        })
    }
}

fn quantity(file: &TomlFile, key: &str, name: &str) -> Result<MeasuredQuantity, InputError> {
    MeasuredQuantity::from_column(name).ok_or_else(|| {
        let names = MeasuredQuantity::ALL.map(MeasuredQuantity::column).join(", ");
        file.error_at(key, "is not a known quantity").with_allowed(names)
    })
}

fn conversion(
    file: &TomlFile,
    key: &str,
    quantity: MeasuredQuantity,
    column: &DetailedColumnToml,
) -> Result<UnitConversion, InputError> {
    if !(column.scale.is_finite() && column.scale != 0.0 && column.offset.is_finite()) {
        return Err(file.error_at(key, "has a scale of zero or a number that is not finite"));
    }
    let unit = match column.unit.as_deref() {
        None => UnitConversion::NONE,
        Some(unit) => quantity.conversion(unit).map_err(|known| {
            file.error_at(key, format!("has a unit that is unknown for {}", quantity.column()))
                .with_value(unit)
                .with_allowed(known)
        })?,
    };
    // Scale and offset convert raw counts to the stated unit; the unit's conversion follows.
    Ok(UnitConversion { scale: column.scale * unit.scale, offset: column.offset * unit.scale + unit.offset })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Mapping, InputError> {
        Mapping::from_toml(&TomlFile::from_text(Path::new("map.toml"), text.into())?)
    }

    #[test]
    fn columns_constants_and_units_are_parsed() {
        let mapping = parse(
            "schema = 1\n[columns]\np_h_mpa = { from = \"PS1\", unit = \"bar\", scale = 0.5, offset = 2.0 }\n\
             t_b_c = \"TS1\"\n[constants]\nn_p_rpm = 1000.0\n",
        )
        .unwrap();
        let Some(ColumnSource::Column(name, conversion)) =
            mapping.sources.get(&MeasuredQuantity::HighPressure)
        else {
            panic!()
        };
        assert_eq!(name, "PS1");
        // 300 counts are 152 bar, are 15.2 MPa.
        assert!((conversion.apply(300.0) - 15.2).abs() < 1e-12);
        assert_eq!(mapping.sources.get(&MeasuredQuantity::PumpSpeed), Some(&ColumnSource::Constant(1000.0)));
    }

    #[test]
    fn errors_name_line_and_allowed_values() {
        for (text, line, part) in [
            ("schema = 1\n[columns]\np_high = \"PS1\"\n", 3, "n_p_rpm"),
            ("schema = 1\n[columns]\np_h_mpa = { from = \"a\", unit = \"K\" }\n", 3, "bar"),
            ("schema = 1\n[constants]\nt_b_c = 333.0\n", 3, "150"),
            ("schema = 2\n", 1, "1"),
        ] {
            let error = parse(text).unwrap_err();
            assert_eq!(error.line, Some(line), "{error}");
            assert!(error.to_string().contains(part), "{error}");
        }
    }

    #[test]
    fn row_filter_compares_modulo_and_rejects_nan() {
        let filter =
            RowFilter { column: "t".into(), modulo: Some(60.0), ranges: vec![[13.0, 18.0], [22.0, 28.0]] };
        assert!(filter.matches(43920.0 + 13.0) && filter.matches(28.0));
        assert!(!filter.matches(20.0) && !filter.matches(f64::NAN));
    }
}
