//! Valve-plate areas from a table of angle against area, one row per angle, as CAD or CFD exports it.
//!
//! Columns `angle_deg,area_a_mm2,area_b_mm2`; lines that start with `#` are comments. The angle is that of the chamber
//! from its own top dead centre, from 0 to 360 with both ends present and equal.

use std::path::Path;

use crate::input::{InvalidInput, Range, TomlFile};

use super::parts::PlateTable;

/// A table finer than a hundredth of a degree is a mistake of export.
const MAX_ROWS: usize = 36_001;
const AREA: Range = Range::new(0.0, 100_000.0, "mm2");
/// Ends of the table may differ by rounding of the export only.
const CLOSURE_MM2: f64 = 0.01;

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Row {
    angle_deg: f64,
    area_a_mm2: f64,
    area_b_mm2: f64,
}

/// Reads the table `name`, which stands under `key` of the machine file and beside it on disk.
pub(super) fn read(file: &TomlFile, key: &str, name: &str) -> Result<PlateTable, InvalidInput> {
    let path = file.path().parent().unwrap_or(Path::new("")).join(name);
    let text = std::fs::read(&path)
        .map_err(|e| file.error_at(key, format!("names a table that cannot be read: {e}")))?;
    parse(&path, &text)
}

/// Parses and checks the text of a table.
pub(super) fn parse(path: &Path, text: &[u8]) -> Result<PlateTable, InvalidInput> {
    let fail = |line: u64, what: &str| {
        let error = InvalidInput::new(what.to_string()).at_file(path);
        if line > 0 { error.at_line(line) } else { error }
    };
    let mut reader = csv::ReaderBuilder::new().comment(Some(b'#')).trim(csv::Trim::All).from_reader(text);
    let headers = reader.headers().map_err(|e| fail(1, &e.to_string()))?.clone();
    let mut table = PlateTable { angle_deg: Vec::new(), area_a_mm2: Vec::new(), area_b_mm2: Vec::new() };
    for record in reader.records() {
        let record = record.map_err(|e| fail(e.position().map_or(0, csv::Position::line), &e.to_string()))?;
        let line = record.position().map_or(0, csv::Position::line);
        let row: Row = record.deserialize(Some(&headers)).map_err(|e| fail(line, &e.to_string()))?;
        for (column, area) in [("area_a_mm2", row.area_a_mm2), ("area_b_mm2", row.area_b_mm2)] {
            if !AREA.contains(area) {
                let error = fail(line, "is out of range").at_column(column);
                return Err(error.with_value(area).with_allowed(AREA));
            }
        }
        let previous = table.angle_deg.last().copied();
        let increasing = previous.map_or(row.angle_deg == 0.0, |last| row.angle_deg > last);
        if !increasing || !row.angle_deg.is_finite() || row.angle_deg > 360.0 {
            let error = fail(line, "angles must start at 0 and increase to 360").at_column("angle_deg");
            return Err(error.with_value(row.angle_deg));
        }
        table.angle_deg.push(row.angle_deg);
        table.area_a_mm2.push(row.area_a_mm2);
        table.area_b_mm2.push(row.area_b_mm2);
        if table.angle_deg.len() > MAX_ROWS {
            return Err(fail(line, "has too many rows").with_allowed(format!("at most {MAX_ROWS}")));
        }
    }
    if table.angle_deg.last() != Some(&360.0) {
        return Err(fail(0, "angles must end at 360").at_column("angle_deg"));
    }
    for (column, area) in [("area_a_mm2", &table.area_a_mm2), ("area_b_mm2", &table.area_b_mm2)] {
        let (first, last) = (area.first().copied().unwrap_or(0.0), area.last().copied().unwrap_or(0.0));
        if (first - last).abs() > CLOSURE_MM2 {
            return Err(fail(0, "differs between 0 and 360 deg").at_column(column).with_value(last - first));
        }
        if area.iter().all(|&a| a <= 0.0) {
            return Err(fail(0, "is zero everywhere: the port never opens").at_column(column));
        }
    }
    Ok(table)
}
