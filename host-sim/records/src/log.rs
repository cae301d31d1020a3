//! Time-series logs, converted row by row to estimator samples.
//!
//! Readings are not validated here; the estimator does that. An empty cell is a missing reading, the name of a fault
//! (`open`, `short`, `stuck`, ...) a faulty one; `NaN` and `inf` are passed on. Any other text is an error.

use std::path::Path;

use kou_estimator::units::{Celsius, LitrePerMin, Megapascal, Micros, Ratio, RevPerMin};
use kou_estimator::{Fault, Reading, Sample};

use crate::input_error::InputError;
use crate::mapping::Mapping;
use crate::quantity::MeasuredQuantity;
use crate::table::{Table, TableCell};

/// Row of a log.
#[derive(Debug, Clone, PartialEq)]
pub struct LogRow {
    /// Line in the file, from 1.
    pub line: u64,
    /// Time as stated in the file.
    pub time_s: f64,
    /// Sensor readings.
    pub sample: Sample,
    /// Cells of the columns copied to the output.
    pub carried: Vec<String>,
}

/// Streaming reader of a log; iterates over its rows.
#[derive(Debug)]
pub struct LogReader {
    table: Table,
}

impl LogReader {
    /// Opens a log.
    ///
    /// # Errors
    /// An unreadable file, or a missing column that every estimate needs.
    pub fn open(path: &Path, mapping: &Mapping) -> Result<Self, InputError> {
        let table = Table::open(path, mapping)?;
        for quantity in [
            MeasuredQuantity::Time,
            MeasuredQuantity::PumpSpeed,
            MeasuredQuantity::HighPressure,
            MeasuredQuantity::OilTemperature,
        ] {
            if !table.has(quantity) {
                return Err(table.missing_column(&format!("`{}`", quantity.column())));
            }
        }
        if !table.has(MeasuredQuantity::MotorSpeed) && !table.has(MeasuredQuantity::Flow) {
            return Err(
                table.missing_column("`n_m_rpm` and no column `flow_l_min`; one of the two is needed")
            );
        }
        Ok(Self { table })
    }

    /// Names of the columns copied to the output.
    #[must_use]
    pub fn carried_names(&self) -> Vec<String> {
        self.table.carried_names().map(str::to_string).collect()
    }

    /// Number of rows rejected by the row filters so far.
    #[must_use]
    pub fn skipped_rows(&self) -> u64 {
        self.table.skipped_rows()
    }

    fn row(&self) -> Result<LogRow, InputError> {
        let time_s = self.table.required(MeasuredQuantity::Time)?;
        // f64 seconds resolve 1 us for 285 years.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in 0..1e18 by its range")]
        let time = Micros((time_s * 1e6).round() as u64);
        let sample = Sample {
            time,
            pump_speed: self.reading(MeasuredQuantity::PumpSpeed, time, RevPerMin)?,
            motor_speed: self.reading(MeasuredQuantity::MotorSpeed, time, RevPerMin)?,
            high_pressure: self.reading(MeasuredQuantity::HighPressure, time, Megapascal)?,
            low_pressure: self.reading(MeasuredQuantity::LowPressure, time, Megapascal)?,
            oil_temperature: self.reading(MeasuredQuantity::OilTemperature, time, Celsius)?,
            displacement: self.reading(MeasuredQuantity::Displacement, time, Ratio)?,
            flow: self.reading(MeasuredQuantity::Flow, time, LitrePerMin)?,
        };
        let carried = self.table.carried().map(str::to_string).collect();
        Ok(LogRow { line: self.table.line(), time_s, sample, carried })
    }

    fn reading<U>(
        &self,
        quantity: MeasuredQuantity,
        time: Micros,
        unit: fn(f32) -> U,
    ) -> Result<Reading<U>, InputError> {
        match self.table.cell(quantity) {
            None => Ok(Reading::not_fitted()),
            Some(TableCell::Missing) => Ok(Reading::failed(time, Fault::Missing)),
            #[allow(clippy::cast_possible_truncation, reason = "the estimator works in f32")]
            Some(TableCell::Number(value)) => Ok(Reading::new(time, unit(value as f32))),
            Some(TableCell::Text(text)) => match Fault::ALL.into_iter().find(|fault| fault.name() == text) {
                Some(fault) => Ok(Reading::failed(time, fault)),
                None => {
                    let faults = Fault::ALL.map(Fault::name).join(", ");
                    Err(self
                        .table
                        .error(quantity, "is neither a number nor the name of a fault")
                        .with_allowed(format!("a number, an empty cell, or one of {faults}")))
                }
            },
        }
    }
}

impl Iterator for LogReader {
    type Item = Result<LogRow, InputError>;

    fn next(&mut self) -> Option<Self::Item> {
        match self.table.advance() {
            Ok(true) => Some(self.row()),
            Ok(false) => None,
            Err(error) => Some(Err(error)),
        }
    }
}
