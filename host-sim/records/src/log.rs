//! Logs: one row per time, turned into the estimator's samples without judging them.
//!
//! An empty cell is a reading that is missing, the name of a fault (`open`, `short`, `stuck`, ...) is that fault, `NaN`
//! and `inf` are what they are: the estimator decides. Only what cannot be a reading at all ends the reading.

use std::path::Path;

use kou_estimator::units::{Celsius, LitrePerMin, Megapascal, Micros, Ratio, RevPerMin};
use kou_estimator::{Fault, Reading, Sample};

use crate::InputError;
use crate::table::{Cell, Mapping, Quantity, Table};

/// One row of a log.
#[derive(Debug, Clone, PartialEq)]
pub struct LogRow {
    /// Line in the file, from 1.
    pub line: u64,
    /// Time as the file states it.
    pub time_s: f64,
    /// The readings.
    pub sample: Sample,
    /// Cells of the columns that the mapping carries over.
    pub carried: Vec<String>,
}

/// A log being read.
#[derive(Debug)]
pub struct LogReader {
    table: Table,
}

impl LogReader {
    /// Opens a log.
    ///
    /// # Errors
    /// When the file cannot be read or lacks a column without which no estimate can be made.
    pub fn open(path: &Path, mapping: &Mapping) -> Result<Self, InputError> {
        let table = Table::open(path, mapping)?;
        for quantity in
            [Quantity::Time, Quantity::PumpSpeed, Quantity::HighPressure, Quantity::OilTemperature]
        {
            if !table.has(quantity) {
                return Err(table.lacks(&format!("`{}`", quantity.column())));
            }
        }
        if !table.has(Quantity::MotorSpeed) && !table.has(Quantity::Flow) {
            return Err(table.lacks("`n_m_rpm` and no column `flow_l_min`; one of the two is needed"));
        }
        Ok(Self { table })
    }

    /// Names of the carried columns.
    #[must_use]
    pub fn carried_names(&self) -> Vec<String> {
        self.table.carried_names().map(str::to_string).collect()
    }

    /// Rows that the mapping's conditions passed over so far.
    #[must_use]
    pub fn passed_over(&self) -> u64 {
        self.table.passed_over()
    }

    fn row(&self) -> Result<LogRow, InputError> {
        let time_s = self.table.required(Quantity::Time)?;
        // Microseconds: exact for logs of up to 285 years.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in 0..1e18 by its range")]
        let time = Micros((time_s * 1e6).round() as u64);
        let sample = Sample {
            time,
            pump_speed: self.reading(Quantity::PumpSpeed, time, RevPerMin)?,
            motor_speed: self.reading(Quantity::MotorSpeed, time, RevPerMin)?,
            high_pressure: self.reading(Quantity::HighPressure, time, Megapascal)?,
            low_pressure: self.reading(Quantity::LowPressure, time, Megapascal)?,
            oil_temperature: self.reading(Quantity::OilTemperature, time, Celsius)?,
            displacement: self.reading(Quantity::Displacement, time, Ratio)?,
            flow: self.reading(Quantity::Flow, time, LitrePerMin)?,
        };
        let carried = self.table.carried().map(str::to_string).collect();
        Ok(LogRow { line: self.table.line(), time_s, sample, carried })
    }

    fn reading<U>(
        &self,
        quantity: Quantity,
        time: Micros,
        unit: fn(f32) -> U,
    ) -> Result<Reading<U>, InputError> {
        match self.table.cell(quantity) {
            None => Ok(Reading::not_fitted()),
            Some(Cell::Missing) => Ok(Reading::failed(time, Fault::Missing)),
            #[allow(clippy::cast_possible_truncation, reason = "the estimator works in f32")]
            Some(Cell::Number(value)) => Ok(Reading::new(time, unit(value as f32))),
            Some(Cell::Text(text)) => match Fault::ALL.into_iter().find(|fault| fault.name() == text) {
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
