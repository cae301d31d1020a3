//! Estimates as a CSV file: one row per sample, empty cells where a part is not valid, its reason beside them.

use std::fs::File;
use std::path::{Path, PathBuf};

use kou_estimator::{Estimate, Expected, Observed};

use super::health::{cause_names, gate_label, stage_name};
use super::reason_label;
use kou_records::InputError;
use kou_records::LogRow;

const COLUMNS: [&str; 22] = [
    "time_s",
    "line",
    "reason",
    "kou_law",
    "kou_law_se",
    "ratio_law",
    "efficiency_law",
    "leakage_law_l_min",
    "kou_seen",
    "kou_seen_se",
    "ratio_seen",
    "efficiency_seen",
    "leakage_seen_l_min",
    "wear_ratio",
    "gate",
    "level",
    "level_se",
    "ratio_offset",
    "changes",
    "causes",
    "wear",
    "sensor",
];

/// A file of estimates being written.
#[derive(Debug)]
pub struct EstimateWriter {
    path: PathBuf,
    writer: csv::Writer<File>,
}

impl EstimateWriter {
    /// Creates the file, and its folder, and writes the heading.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn create(path: &Path, carried: &[String]) -> Result<Self, InputError> {
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder)
                .map_err(|e| InputError::new(format!("its folder cannot be made: {e}")).at_file(path))?;
        }
        let file = File::create(path)
            .map_err(|e| InputError::new(format!("cannot be written: {e}")).at_file(path))?;
        let mut this = Self { path: path.to_path_buf(), writer: csv::Writer::from_writer(file) };
        let heading: Vec<&str> = COLUMNS.into_iter().chain(carried.iter().map(String::as_str)).collect();
        this.record(&heading)?;
        Ok(this)
    }

    /// Writes the row of one sample.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write(&mut self, row: &LogRow, estimate: &Estimate) -> Result<(), InputError> {
        let reason = estimate.wear_ratio().err().map(reason_label).unwrap_or_default();
        let mut cells = vec![row.time_s.to_string(), row.line.to_string(), reason];
        cells.extend(match estimate.expected {
            Ok(Expected { kou, kou_se, ratio, volumetric_efficiency, leakage }) => {
                [kou.get(), kou_se.get(), ratio.get(), volumetric_efficiency.get(), leakage.get()]
                    .map(|v| v.to_string())
            }
            Err(_) => [const { String::new() }; 5],
        });
        cells.extend(match estimate.observed {
            Ok(Observed { ratio, kou, kou_se, volumetric_efficiency, leakage }) => {
                [kou.get(), kou_se.get(), ratio.get(), volumetric_efficiency.get(), leakage.get()]
                    .map(|v| v.to_string())
            }
            Err(_) => [const { String::new() }; 5],
        });
        cells.push(estimate.wear_ratio().map(|w| w.get().to_string()).unwrap_or_default());
        let health = &estimate.health;
        cells.push(health.gate.err().map_or_else(|| "open".to_string(), gate_label));
        cells.extend(
            [health.level, health.level_se, health.ratio_offset].map(|number| number.get().to_string()),
        );
        cells.push(health.changes.to_string());
        cells.push(cause_names(health).join(" "));
        cells.extend([health.wear, health.sensor].map(|stage| stage_name(stage).to_string()));
        let all: Vec<&str> = cells.iter().chain(&row.carried).map(String::as_str).collect();
        self.record(&all)
    }

    /// Writes what is still buffered.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn finish(mut self) -> Result<(), InputError> {
        self.writer
            .flush()
            .map_err(|e| InputError::new(format!("cannot be written: {e}")).at_file(&self.path))
    }

    fn record(&mut self, cells: &[&str]) -> Result<(), InputError> {
        self.writer
            .write_record(cells)
            .map_err(|e| InputError::new(format!("cannot be written: {e}")).at_file(&self.path))
    }
}
