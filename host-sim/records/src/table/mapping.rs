//! Mapping file: how a bench engineer's own CSV becomes our quantities, without editing it. Format: `docs/files.md`.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;

use super::units::{Conversion, Quantity};
use crate::{InputError, TomlFile};

/// Schema of mapping files that this version reads.
const SCHEMA: u32 = 1;

/// Where a quantity comes from.
#[derive(Debug, Clone, PartialEq)]
pub enum Source {
    /// A column of the file, with its conversion.
    Column(String, Conversion),
    /// The same value in every row.
    Constant(f64),
}

/// Condition that a row must fulfil to be read.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Select {
    /// Column of the file.
    pub column: String,
    /// Take the value modulo this before comparing.
    #[serde(default)]
    pub modulo: Option<f64>,
    /// Closed intervals of which the value must lie in one.
    pub ranges: Vec<[f64; 2]>,
}

impl Select {
    /// Whether a row with this value is read; a value that is no number never is.
    #[must_use]
    pub fn takes(&self, value: f64) -> bool {
        let value = match self.modulo {
            Some(modulo) => value.rem_euclid(modulo),
            None => value,
        };
        self.ranges.iter().any(|[low, high]| value >= *low && value <= *high)
    }
}

/// A checked mapping.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Mapping {
    /// Sources of the quantities it names; the others come from columns of our own names.
    pub sources: BTreeMap<Quantity, Source>,
    /// Cells that mean that there is no reading.
    pub missing: Vec<String>,
    /// Character between cells; found from the heading when absent.
    pub delimiter: Option<u8>,
    /// Whether numbers are written with a comma.
    pub decimal_comma: bool,
    /// Conditions on rows; all must hold.
    pub select: Vec<Select>,
    /// Columns of the file that are copied to the output.
    pub carry: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Raw {
    schema: u32,
    #[serde(default)]
    columns: BTreeMap<String, RawColumn>,
    #[serde(default)]
    constants: BTreeMap<String, f64>,
    #[serde(default)]
    missing: Vec<String>,
    delimiter: Option<String>,
    decimal: Option<String>,
    #[serde(default)]
    select: Vec<Select>,
    #[serde(default)]
    carry: Vec<String>,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum RawColumn {
    Name(String),
    Full(RawFull),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawFull {
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
    /// Anything that is not understood, with line and column.
    pub fn read(path: &Path) -> Result<Self, InputError> {
        Self::from_toml(&TomlFile::read(path)?)
    }

    fn from_toml(file: &TomlFile) -> Result<Self, InputError> {
        let raw: Raw = file.parse()?;
        if raw.schema != SCHEMA {
            return Err(file.error_at("schema", "is not known to this version").with_allowed(SCHEMA));
        }
        let mut sources = BTreeMap::new();
        for (name, column) in raw.columns {
            let key = format!("columns.{name}");
            let quantity = quantity(file, &key, &name)?;
            let source = match column {
                RawColumn::Name(from) => Source::Column(from, Conversion::NONE),
                RawColumn::Full(full) => {
                    Source::Column(full.from.clone(), conversion(file, &key, quantity, &full)?)
                }
            };
            sources.insert(quantity, source);
        }
        for (name, value) in raw.constants {
            let key = format!("constants.{name}");
            let quantity = quantity(file, &key, &name)?;
            file.check(&key, value, quantity.bench_range())?;
            if sources.insert(quantity, Source::Constant(value)).is_some() {
                return Err(file.error_at(&key, "is mapped to a column as well; one of the two must go"));
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

fn quantity(file: &TomlFile, key: &str, name: &str) -> Result<Quantity, InputError> {
    Quantity::from_column(name).ok_or_else(|| {
        let names = Quantity::ALL.map(Quantity::column).join(", ");
        file.error_at(key, "is no quantity of ours").with_allowed(names)
    })
}

fn conversion(
    file: &TomlFile,
    key: &str,
    quantity: Quantity,
    full: &RawFull,
) -> Result<Conversion, InputError> {
    if !(full.scale.is_finite() && full.scale != 0.0 && full.offset.is_finite()) {
        return Err(file.error_at(key, "has a scale of zero or a number that is not finite"));
    }
    let unit = match full.unit.as_deref() {
        None => Conversion::NONE,
        Some(unit) => quantity.conversion(unit).map_err(|known| {
            file.error_at(key, format!("has a unit that is not known for {}", quantity.column()))
                .with_value(unit)
                .with_allowed(known)
        })?,
    };
    // The file's number is scaled and offset first (raw counts to its unit), then converted to our unit.
    Ok(Conversion { scale: full.scale * unit.scale, offset: full.offset * unit.scale + unit.offset })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Mapping, InputError> {
        Mapping::from_toml(&TomlFile::from_text(Path::new("map.toml"), text.into())?)
    }

    #[test]
    fn columns_constants_and_units_are_understood() {
        let mapping = parse(
            "schema = 1\n[columns]\np_h_mpa = { from = \"PS1\", unit = \"bar\", scale = 0.5, offset = 2.0 }\n\
             t_b_c = \"TS1\"\n[constants]\nn_p_rpm = 1000.0\n",
        )
        .unwrap();
        let Some(Source::Column(name, conversion)) = mapping.sources.get(&Quantity::HighPressure) else {
            panic!()
        };
        assert_eq!(name, "PS1");
        // 300 counts are 152 bar, are 15.2 MPa.
        assert!((conversion.apply(300.0) - 15.2).abs() < 1e-12);
        assert_eq!(mapping.sources.get(&Quantity::PumpSpeed), Some(&Source::Constant(1000.0)));
    }

    #[test]
    fn mistakes_name_line_and_what_is_allowed() {
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
    fn select_works_modulo_and_refuses_nan() {
        let select =
            Select { column: "t".into(), modulo: Some(60.0), ranges: vec![[13.0, 18.0], [22.0, 28.0]] };
        assert!(select.takes(43920.0 + 13.0) && select.takes(28.0));
        assert!(!select.takes(20.0) && !select.takes(f64::NAN));
    }
}
