//! Bench tables: steady operating points with the measured speed ratio.

use std::path::Path;

use crate::input_error::InputError;
use crate::mapping::Mapping;
use crate::quantity::MeasuredQuantity;
use crate::table::{Table, TableCell};

/// Minimum number of points of a table.
const MIN_POINTS: usize = 1;
/// Maximum number of points of a table: separates a table of steady points from a log.
const MAX_POINTS: usize = 10_000;

/// Measured steady operating point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BenchPoint {
    /// Line in the file, from 1.
    pub line: u64,
    /// Pump speed.
    pub n_p_rpm: f64,
    /// High pressure, gauge.
    pub p_h_mpa: f64,
    /// Low pressure, gauge; `None` where it was not measured.
    pub p_l_mpa: Option<f64>,
    /// Oil temperature.
    pub t_b_c: f64,
    /// Displacement fraction.
    pub alpha: f64,
    /// Measured speed ratio.
    pub ratio: f64,
}

/// Reads a bench table. The speed ratio is a column, or computed from the motor speed, or from the flow and the reference
/// displacement.
///
/// # Errors
/// The first missing, non-numeric or out-of-range cell, with line, column, value and range.
pub fn read_bench(
    path: &Path,
    mapping: &Mapping,
    reference_displacement_cm3_per_rev: f64,
) -> Result<Vec<BenchPoint>, InputError> {
    let mut table = Table::open(path, mapping)?;
    for quantity in
        [MeasuredQuantity::PumpSpeed, MeasuredQuantity::HighPressure, MeasuredQuantity::OilTemperature]
    {
        if !table.has(quantity) {
            return Err(table.missing_column(&format!("`{}`", quantity.column())));
        }
    }
    let measured = [MeasuredQuantity::Ratio, MeasuredQuantity::MotorSpeed, MeasuredQuantity::Flow]
        .into_iter()
        .find(|q| table.has(*q))
        .ok_or_else(|| {
            table.missing_column("`ratio`, `n_m_rpm` or `flow_l_min`; one of the three is needed")
        })?;
    let mut points = Vec::new();
    while table.advance()? {
        let n_p_rpm = table.required(MeasuredQuantity::PumpSpeed)?;
        let number = table.required(measured)?;
        let ratio = match measured {
            MeasuredQuantity::MotorSpeed => number / n_p_rpm,
            MeasuredQuantity::Flow => 1000.0 * number / (n_p_rpm * reference_displacement_cm3_per_rev),
            _ => number,
        };
        let alpha = match table.cell(MeasuredQuantity::Displacement) {
            None | Some(TableCell::Missing) => 1.0,
            Some(_) => table.required(MeasuredQuantity::Displacement)?,
        };
        if !MeasuredQuantity::Ratio.bench_range().contains(ratio) || ratio == 0.0 || ratio * alpha <= 0.0 {
            return Err(table
                .error(measured, format!("gives a speed ratio of {ratio} at a displacement of {alpha}"))
                .with_allowed(format!(
                    "{}, not 0, with the sign of the displacement",
                    MeasuredQuantity::Ratio.bench_range()
                )));
        }
        if points.len() == MAX_POINTS {
            let message =
                format!("has more than {MAX_POINTS} points; is it a log, not a table of steady points?");
            return Err(InputError::new(message).at_file(path).at_line(table.line()));
        }
        points.push(BenchPoint {
            line: table.line(),
            n_p_rpm,
            p_h_mpa: table.required(MeasuredQuantity::HighPressure)?,
            p_l_mpa: match table.cell(MeasuredQuantity::LowPressure) {
                None => None,
                Some(_) => Some(table.required(MeasuredQuantity::LowPressure)?),
            },
            t_b_c: table.required(MeasuredQuantity::OilTemperature)?,
            alpha,
            ratio,
        });
    }
    if points.len() < MIN_POINTS {
        let message = format!("has no points ({} rows skipped by the mapping)", table.skipped_rows());
        return Err(InputError::new(message).at_file(path));
    }
    Ok(points)
}

/// Separates exact duplicates: the distinct points, and each duplicate with the line of its first occurrence.
#[must_use]
pub fn split_duplicates(points: Vec<BenchPoint>) -> (Vec<BenchPoint>, Vec<(BenchPoint, u64)>) {
    let mut first = std::collections::HashMap::new();
    let (mut distinct, mut duplicates) = (Vec::new(), Vec::new());
    for p in points {
        let low = p.p_l_mpa.map(f64::to_bits);
        let key = ([p.n_p_rpm, p.p_h_mpa, p.t_b_c, p.alpha, p.ratio].map(f64::to_bits), low);
        match first.get(&key) {
            Some(line) => duplicates.push((p, *line)),
            None => {
                first.insert(key, p.line);
                distinct.push(p);
            }
        }
    }
    (distinct, duplicates)
}
