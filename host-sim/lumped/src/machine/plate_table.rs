//! Table of valve-plate areas in CSV, one row per angle, as CAD or CFD exports it.
//!
//! Columns `angle_deg,area_a_mm2,area_b_mm2`; lines that start with `#` are comments. The angle is that of the chamber
//! from its own top dead centre, from 0 to 360 with both ends present and equal.

use std::path::Path;

use crate::invalid_input::{FilePosition, InvalidInput};
use crate::value_range::ValueRange;

use super::parts::PlateTable;
use super::source::MachineSource;

/// Rows at a hundredth of a degree; a finer table is an export error.
const MAX_ROWS: usize = 36_001;
const AREA: ValueRange = ValueRange::new(0.0, 100_000.0, "mm2");
/// Largest difference between the areas at 0 and 360 deg, for rounding of the export.
const CLOSURE_MM2: f64 = 0.01;

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct PlateRow {
    angle_deg: f64,
    area_a_mm2: f64,
    area_b_mm2: f64,
}

/// Reads the table whose file name stands under `key` of a machine file, from that file's folder.
pub(super) fn read(source: &MachineSource, key: &str, name: &str) -> Result<PlateTable, InvalidInput> {
    let path = source.path().parent().unwrap_or(Path::new("")).join(name);
    let text = std::fs::read(&path)
        .map_err(|e| source.error_at(key, format!("names a table that cannot be read: {e}")))?;
    parse(&path, &text)
}

/// Parses and checks the text of a table.
pub(super) fn parse(path: &Path, text: &[u8]) -> Result<PlateTable, InvalidInput> {
    let error = |line: u64, column: Option<&str>, message: &str| {
        let line = usize::try_from(line).ok().filter(|line| *line > 0);
        let column = column.map(String::from);
        InvalidInput::new(message).at(FilePosition { line, column, ..FilePosition::file(path) })
    };
    let mut reader = csv::ReaderBuilder::new().comment(Some(b'#')).trim(csv::Trim::All).from_reader(text);
    let headers = reader.headers().map_err(|e| error(1, None, &e.to_string()))?.clone();
    let mut table = PlateTable { angle_deg: Vec::new(), area_a_mm2: Vec::new(), area_b_mm2: Vec::new() };
    for record in reader.records() {
        let record =
            record.map_err(|e| error(e.position().map_or(0, csv::Position::line), None, &e.to_string()))?;
        let line = record.position().map_or(0, csv::Position::line);
        let row: PlateRow =
            record.deserialize(Some(&headers)).map_err(|e| error(line, None, &e.to_string()))?;
        for (column, area) in [("area_a_mm2", row.area_a_mm2), ("area_b_mm2", row.area_b_mm2)] {
            if !AREA.contains(area) {
                let error = error(line, Some(column), "is out of range");
                return Err(error.with_value(area).with_allowed(AREA));
            }
        }
        let previous = table.angle_deg.last().copied();
        let increasing = previous.map_or(row.angle_deg == 0.0, |last| row.angle_deg > last);
        if !increasing || !row.angle_deg.is_finite() || row.angle_deg > 360.0 {
            let message = "angles must start at 0 and increase to 360";
            return Err(error(line, Some("angle_deg"), message).with_value(row.angle_deg));
        }
        table.angle_deg.push(row.angle_deg);
        table.area_a_mm2.push(row.area_a_mm2);
        table.area_b_mm2.push(row.area_b_mm2);
        if table.angle_deg.len() > MAX_ROWS {
            return Err(error(line, None, "has too many rows").with_allowed(format!("at most {MAX_ROWS}")));
        }
    }
    if table.angle_deg.last() != Some(&360.0) {
        return Err(error(0, Some("angle_deg"), "angles must end at 360"));
    }
    for (column, area) in [("area_a_mm2", &table.area_a_mm2), ("area_b_mm2", &table.area_b_mm2)] {
        let (first, last) = (area.first().copied().unwrap_or(0.0), area.last().copied().unwrap_or(0.0));
        if (first - last).abs() > CLOSURE_MM2 {
            return Err(error(0, Some(column), "differs between 0 and 360 deg").with_value(last - first));
        }
        if area.iter().all(|&a| a <= 0.0) {
            return Err(error(0, Some(column), "is zero everywhere: the port never opens"));
        }
    }
    Ok(table)
}
