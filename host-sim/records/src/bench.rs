//! Bench tables: steady operating points with the speed ratio that was measured there.

use std::path::Path;

use crate::InputError;
use crate::table::{Cell, Mapping, Quantity, Table};

/// Fewest points from which anything can be identified.
const MIN_POINTS: usize = 1;
/// Most points of a table. A bench table holds steady points, each the mean of a record; a record itself has more rows.
const MAX_POINTS: usize = 10_000;

/// One steady operating point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BenchPoint {
    /// Line in the file, from 1.
    pub line: u64,
    /// Pump speed.
    pub n_p_rpm: f64,
    /// High pressure, gauge.
    pub p_h_mpa: f64,
    /// Low pressure, gauge; nothing where the table lacks it.
    pub p_l_mpa: Option<f64>,
    /// Oil temperature.
    pub t_b_c: f64,
    /// Displacement fraction.
    pub alpha: f64,
    /// Measured speed ratio.
    pub ratio: f64,
}

/// Reads a bench table. The ratio is a column of its own, or follows from the motor's speed, or from the flow and the
/// displacement to which the ratio refers.
///
/// # Errors
/// The first cell that is missing, no number or out of range, with line, column, value and range.
pub fn read_bench(
    path: &Path,
    mapping: &Mapping,
    reference_displacement_cm3_per_rev: f64,
) -> Result<Vec<BenchPoint>, InputError> {
    let mut table = Table::open(path, mapping)?;
    for quantity in [Quantity::PumpSpeed, Quantity::HighPressure, Quantity::OilTemperature] {
        if !table.has(quantity) {
            return Err(table.lacks(&format!("`{}`", quantity.column())));
        }
    }
    let measured = [Quantity::Ratio, Quantity::MotorSpeed, Quantity::Flow]
        .into_iter()
        .find(|q| table.has(*q))
        .ok_or_else(|| table.lacks("`ratio`, `n_m_rpm` or `flow_l_min`; one of the three is needed"))?;
    let mut points = Vec::new();
    while table.advance()? {
        let n_p_rpm = table.required(Quantity::PumpSpeed)?;
        let number = table.required(measured)?;
        let ratio = match measured {
            Quantity::MotorSpeed => number / n_p_rpm,
            Quantity::Flow => 1000.0 * number / (n_p_rpm * reference_displacement_cm3_per_rev),
            _ => number,
        };
        let alpha = match table.cell(Quantity::Displacement) {
            None | Some(Cell::Missing) => 1.0,
            Some(_) => table.required(Quantity::Displacement)?,
        };
        if !Quantity::Ratio.bench_range().contains(ratio) || ratio == 0.0 || ratio * alpha <= 0.0 {
            return Err(table
                .error(measured, format!("gives a speed ratio of {ratio} at a displacement of {alpha}"))
                .with_allowed(format!(
                    "{}, not 0, with the sign of the displacement",
                    Quantity::Ratio.bench_range()
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
            p_h_mpa: table.required(Quantity::HighPressure)?,
            p_l_mpa: match table.cell(Quantity::LowPressure) {
                None => None,
                Some(_) => Some(table.required(Quantity::LowPressure)?),
            },
            t_b_c: table.required(Quantity::OilTemperature)?,
            alpha,
            ratio,
        });
    }
    if points.len() < MIN_POINTS {
        let message = format!("has no points ({} rows passed over by the mapping)", table.passed_over());
        return Err(InputError::new(message).at_file(path));
    }
    Ok(points)
}

/// Splits points into those that are new and, with the line that each repeats, those that are not.
#[must_use]
pub fn without_repeats(points: Vec<BenchPoint>) -> (Vec<BenchPoint>, Vec<(BenchPoint, u64)>) {
    let mut first = std::collections::HashMap::new();
    let (mut kept, mut repeated) = (Vec::new(), Vec::new());
    for p in points {
        let low = p.p_l_mpa.map(f64::to_bits);
        let key = ([p.n_p_rpm, p.p_h_mpa, p.t_b_c, p.alpha, p.ratio].map(f64::to_bits), low);
        match first.get(&key) {
            Some(line) => repeated.push((p, *line)),
            None => {
                first.insert(key, p.line);
                kept.push(p);
            }
        }
    }
    (kept, repeated)
}
