//! Tables of numbers as they come from benches and vehicles: CSV, read row by row, through a mapping.
//!
//! Lines beginning with `#` are comments. A byte-order mark is skipped. The delimiter is found from the heading. Rows
//! are read one at a time, so a file may be larger than memory.

mod mapping;
mod units;

use std::fmt;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

pub use mapping::{Mapping, Select, Source};
pub use units::{Conversion, Quantity};

use crate::InputError;

/// Longest line that is taken for text; longer ones mean that the file is no table.
const MAX_HEADING_BYTES: usize = 1 << 20;

/// One cell of a quantity.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// A number, in our unit. May be NaN or infinite when the file says so.
    Number(f64),
    /// Nothing, or a text that the mapping declares to mean nothing.
    Missing,
    /// Any other text.
    Text(String),
}

/// Where a quantity is found in a row.
#[derive(Debug, Clone)]
enum Place {
    Column(usize, Conversion),
    Constant(f64),
    Absent,
}

/// A table being read.
pub struct Table {
    path: PathBuf,
    reader: csv::Reader<Box<dyn Read>>,
    record: csv::StringRecord,
    headings: Vec<String>,
    places: Vec<(Quantity, Place)>,
    select: Vec<(usize, Select)>,
    carry: Vec<(usize, String)>,
    missing: Vec<String>,
    decimal_comma: bool,
    passed_over: u64,
}

impl fmt::Debug for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Table").field("path", &self.path).field("line", &self.line()).finish_non_exhaustive()
    }
}

impl Table {
    /// Opens a table and finds its columns.
    ///
    /// # Errors
    /// When the file cannot be read, has no heading, or lacks a column that the mapping names.
    pub fn open(path: &Path, mapping: &Mapping) -> Result<Self, InputError> {
        let file =
            File::open(path).map_err(|e| InputError::new(format!("cannot be opened: {e}")).at_file(path))?;
        Self::from_reader(path, Box::new(file), mapping)
    }

    fn from_reader(path: &Path, source: Box<dyn Read>, mapping: &Mapping) -> Result<Self, InputError> {
        let fail = |what: String| InputError::new(what).at_file(path);
        let mut buffered = BufReader::with_capacity(1 << 16, source);
        let heading_start = peek_heading(&mut buffered).map_err(|e| fail(format!("cannot be read: {e}")))?;
        let delimiter = mapping.delimiter.unwrap_or_else(|| guess_delimiter(&heading_start));
        let whole: Box<dyn Read> = Box::new(std::io::Cursor::new(heading_start).chain(buffered));
        let mut reader = csv::ReaderBuilder::new()
            .comment(Some(b'#'))
            .delimiter(delimiter)
            .trim(csv::Trim::All)
            .from_reader(whole);
        let headings: Vec<String> =
            reader.headers().map_err(|e| csv_error(path, &e))?.iter().map(str::to_string).collect();
        if headings.iter().all(String::is_empty) {
            return Err(fail("is empty: a heading with column names is needed".into()));
        }
        let index = |name: &str| headings.iter().position(|h| h == name);
        let needs = |name: &str, why: &str| {
            index(name).ok_or_else(|| {
                fail(format!("has no column `{name}`, which {why}"))
                    .at_line(1)
                    .with_allowed(headings.join(", "))
            })
        };
        let mut places = Vec::new();
        for quantity in Quantity::ALL {
            let place = match mapping.sources.get(&quantity) {
                Some(Source::Constant(value)) => Place::Constant(*value),
                Some(Source::Column(name, conversion)) => Place::Column(
                    needs(name, &format!("the mapping names for {}", quantity.column()))?,
                    *conversion,
                ),
                None => {
                    index(quantity.column()).map_or(Place::Absent, |i| Place::Column(i, Conversion::NONE))
                }
            };
            places.push((quantity, place));
        }
        let select = mapping
            .select
            .iter()
            .map(|s| Ok((needs(&s.column, "the mapping selects by")?, s.clone())))
            .collect::<Result<_, InputError>>()?;
        let carry = mapping
            .carry
            .iter()
            .map(|name| Ok((needs(name, "the mapping carries over")?, name.clone())))
            .collect::<Result<_, InputError>>()?;
        Ok(Self {
            path: path.to_path_buf(),
            reader,
            record: csv::StringRecord::new(),
            headings,
            places,
            select,
            carry,
            missing: mapping.missing.clone(),
            decimal_comma: mapping.decimal_comma,
            passed_over: 0,
        })
    }

    /// Path of the file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether the table has the quantity, as a column or as a constant.
    #[must_use]
    pub fn has(&self, quantity: Quantity) -> bool {
        self.places.iter().any(|(q, place)| *q == quantity && !matches!(place, Place::Absent))
    }

    /// Error for a quantity that the table must have.
    #[must_use]
    pub fn lacks(&self, what: &str) -> InputError {
        InputError::new(format!("has no column {what}; a mapping file can name another or give a constant"))
            .at_file(&self.path)
            .with_allowed(self.headings.join(", "))
    }

    /// Names of the columns that the mapping carries over.
    pub fn carried_names(&self) -> impl Iterator<Item = &str> {
        self.carry.iter().map(|(_, name)| name.as_str())
    }

    /// Rows that the mapping's conditions passed over so far.
    #[must_use]
    pub fn passed_over(&self) -> u64 {
        self.passed_over
    }

    /// Moves to the next row that the mapping selects; false at the end.
    ///
    /// # Errors
    /// A row with too few or too many cells, or that is not UTF-8, with its line.
    pub fn advance(&mut self) -> Result<bool, InputError> {
        loop {
            if !self.reader.read_record(&mut self.record).map_err(|e| csv_error(&self.path, &e))? {
                return Ok(false);
            }
            let taken = self.select.iter().all(|(i, select)| {
                self.record
                    .get(*i)
                    .and_then(|text| self.number(text))
                    .is_some_and(|value| select.takes(value))
            });
            if taken {
                return Ok(true);
            }
            self.passed_over += 1;
        }
    }

    /// Line of the present row, from 1.
    #[must_use]
    pub fn line(&self) -> u64 {
        self.record.position().map_or(0, csv::Position::line)
    }

    /// The present row's cell of a quantity; nothing when the table lacks it.
    #[must_use]
    pub fn cell(&self, quantity: Quantity) -> Option<Cell> {
        let (_, place) = self.places.iter().find(|(q, _)| *q == quantity)?;
        match place {
            Place::Absent => None,
            Place::Constant(value) => Some(Cell::Number(*value)),
            Place::Column(index, conversion) => {
                let text = self.record.get(*index).unwrap_or_default();
                if text.is_empty() || self.missing.iter().any(|m| m == text) {
                    return Some(Cell::Missing);
                }
                Some(match self.number(text) {
                    Some(number) => Cell::Number(conversion.apply(number)),
                    None => Cell::Text(text.to_string()),
                })
            }
        }
    }

    /// Error about the present row's cell of a quantity.
    #[must_use]
    pub fn error(&self, quantity: Quantity, message: impl Into<String>) -> InputError {
        let error = InputError::new(message).at_file(&self.path).at_line(self.line());
        match self.places.iter().find(|(q, _)| *q == quantity) {
            Some((_, Place::Column(index, _))) => error
                .at_column(format!(
                    "{} ({})",
                    index + 1,
                    self.headings.get(*index).map_or("", String::as_str)
                ))
                .with_value(self.record.get(*index).unwrap_or_default()),
            Some((_, Place::Constant(value))) => error.at_column(quantity.column()).with_value(value),
            _ => error.at_column(quantity.column()),
        }
    }

    /// The present row's number of a quantity that must be there and in its bench range.
    ///
    /// # Errors
    /// When it is missing, no number or out of range.
    pub fn required(&self, quantity: Quantity) -> Result<f64, InputError> {
        let range = quantity.bench_range();
        match self.cell(quantity) {
            Some(Cell::Number(value)) if range.contains(value) => Ok(value),
            Some(Cell::Number(_)) => Err(self.error(quantity, "is out of range").with_allowed(range)),
            Some(Cell::Text(_)) => Err(self.error(quantity, "is not a number").with_allowed(range)),
            Some(Cell::Missing) | None => Err(self.error(quantity, "is missing").with_allowed(range)),
        }
    }

    /// The present row's cells that the mapping carries over.
    pub fn carried(&self) -> impl Iterator<Item = &str> {
        self.carry.iter().map(|(i, _)| self.record.get(*i).unwrap_or_default())
    }

    fn number(&self, text: &str) -> Option<f64> {
        if self.decimal_comma { text.replace(',', ".").parse().ok() } else { text.parse().ok() }
    }
}

/// Reads up to and including the first line that is no comment, without a byte-order mark.
fn peek_heading(reader: &mut impl BufRead) -> std::io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    loop {
        let start = bytes.len();
        let limit = MAX_HEADING_BYTES.saturating_sub(start) as u64;
        if reader.by_ref().take(limit).read_until(b'\n', &mut bytes)? == 0 {
            break;
        }
        if start == 0 && bytes.starts_with(b"\xef\xbb\xbf") {
            bytes.drain(..3);
        }
        if bytes.get(start).is_some_and(|&b| b != b'#' && b != b'\n' && b != b'\r') {
            break;
        }
    }
    Ok(bytes)
}

/// The delimiter that occurs most often in the heading: comma, semicolon or tab.
fn guess_delimiter(bytes: &[u8]) -> u8 {
    let body = bytes.strip_suffix(b"\n").unwrap_or(bytes);
    let heading = body.rsplit(|&b| b == b'\n').next().unwrap_or_default();
    let count = |d: u8| heading.iter().filter(|&&b| b == d).count();
    [b',', b';', b'\t'].into_iter().rev().max_by_key(|&d| count(d)).unwrap_or(b',')
}

fn csv_error(path: &Path, error: &csv::Error) -> InputError {
    let message = match error.kind() {
        csv::ErrorKind::UnequalLengths { expected_len, len, .. } => {
            format!("has {len} cells where the heading has {expected_len}")
        }
        csv::ErrorKind::Utf8 { .. } => "is not UTF-8 text".to_string(),
        _ => format!("cannot be read: {error}"),
    };
    let line = error.position().map(csv::Position::line);
    let result = InputError::new(message).at_file(path);
    match line {
        Some(line) => result.at_line(line),
        None => result,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(text: &'static str, mapping: &Mapping) -> Result<Table, InputError> {
        Table::from_reader(Path::new("t.csv"), Box::new(text.as_bytes()), mapping)
    }

    #[test]
    fn german_table_with_semicolons_and_commas_is_read() {
        let mapping = Mapping { decimal_comma: true, ..Mapping::default() };
        let mut table = table("\u{feff}# Pruefstand 3\nn_p_rpm;p_h_mpa\n999,23;31,06\n", &mapping).unwrap();
        assert!(table.advance().unwrap());
        assert_eq!(table.cell(Quantity::PumpSpeed), Some(Cell::Number(999.23)));
        assert_eq!(table.required(Quantity::HighPressure).unwrap(), 31.06);
        assert!(!table.advance().unwrap());
    }

    #[test]
    fn bad_cells_name_line_column_value_and_range() {
        let mut table =
            table("n_p_rpm,p_h_mpa\n1000,abc\n1000,310\n1000,\n1000\n", &Mapping::default()).unwrap();
        for wanted in [
            "t.csv:2: column 2 (p_h_mpa): is not a number (value `abc`; allowed: 0.5 to 100 MPa)",
            "t.csv:3: column 2 (p_h_mpa): is out of range (value `310`; allowed: 0.5 to 100 MPa)",
            "t.csv:4: column 2 (p_h_mpa): is missing (value ``; allowed: 0.5 to 100 MPa)",
        ] {
            assert!(table.advance().unwrap());
            assert_eq!(table.required(Quantity::HighPressure).unwrap_err().to_string(), wanted);
        }
        assert_eq!(table.advance().unwrap_err().to_string(), "t.csv:5: has 1 cells where the heading has 2");
    }

    #[test]
    fn empty_file_is_named_as_such() {
        assert!(table("", &Mapping::default()).unwrap_err().to_string().contains("is empty"));
    }
}
