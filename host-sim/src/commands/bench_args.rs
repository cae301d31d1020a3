//! Arguments of `identify` and `report`: bench table, machine, prior knowledge.
//!
//! One set for both, so that the report describes the very fit that the calibration is from.

use std::path::{Path, PathBuf};

use super::class_arg::ClassArg;
use super::failure::Failure;
use kou_identify::calibration::CalibrationSettings;
use kou_identify::joint::Prior;
use kou_lumped::machine::Machine;
use kou_records::{BenchPoint, InputError, Mapping, read_bench, split_duplicates};

/// Bench points, machine and prior knowledge.
#[derive(Debug, clap::Args)]
pub struct BenchArgs {
    /// Bench table (CSV): n_p_rpm, p_h_mpa, t_b_c, ratio and optionally alpha, p_l_mpa.
    #[arg(long, value_name = "POINTS.csv")]
    pub bench: PathBuf,
    /// Machine file (TOML).
    #[arg(long, value_name = "M.toml")]
    pub machine: PathBuf,
    /// Mapping file (TOML) for a table with other columns or units.
    #[arg(long, value_name = "MAP.toml")]
    pub map: Option<PathBuf>,
    /// Joint scheme: standard error of the machine file's bulk modulus, relative.
    #[arg(long, default_value_t = 0.1, value_parser = positive)]
    pub bulk_uncertainty: f64,
    /// Joint scheme: standard error of the displacement ratio, relative: machine file and both speed sensors.
    #[arg(long, default_value_t = 0.02, value_parser = positive)]
    pub displacement_uncertainty: f64,
    /// Joint scheme: random error of a measured ratio, 1 sigma, relative.
    #[arg(long, default_value_t = 3e-4, value_parser = positive)]
    pub ratio_error: f64,
    /// Serial number of the machine on the bench.
    #[arg(long, default_value = "")]
    pub serial: String,
    /// Date of the bench test, copied into the calibration.
    #[arg(long, default_value = "")]
    pub date: String,
    /// ISO 4409 class of the sensors on the controller, for the standard error of the observed coefficient.
    #[arg(long, value_enum, default_value = "A")]
    pub class: ClassArg,
}

/// Contents of the files, checked.
#[derive(Debug)]
pub struct BenchInputs {
    /// The machine.
    pub machine: Machine,
    /// The points, each once.
    pub points: Vec<BenchPoint>,
    /// Rows that repeat another one, with the line of that one.
    pub repeated: Vec<(BenchPoint, u64)>,
    /// Origin that the calibration records.
    pub settings: CalibrationSettings,
    /// Prior knowledge.
    pub prior: Prior,
}

impl BenchArgs {
    /// Reads the files.
    ///
    /// # Errors
    /// A file that cannot be read or holds an impossible value.
    pub fn read(&self) -> Result<BenchInputs, Failure> {
        let machine = Machine::load(&self.machine)?;
        let points = read_bench(
            &self.bench,
            &mapping(self.map.as_deref())?,
            machine.reference_displacement_cm3_per_rev(),
        )?;
        let (points, repeated) = split_duplicates(points);
        let settings = CalibrationSettings {
            serial: self.serial.clone(),
            date: self.date.clone(),
            class: self.class.into(),
            bench_crc32: crc32_of(&self.bench)?,
            machine_crc32: crc32_of(&self.machine)?,
        };
        let prior = Prior {
            bulk: self.bulk_uncertainty,
            displacement: self.displacement_uncertainty,
            ratio: self.ratio_error,
            ..Prior::default()
        };
        Ok(BenchInputs { machine, points, repeated, settings, prior })
    }
}

/// Reads a mapping file; without one, the tool's own columns and units hold.
pub(super) fn mapping(path: Option<&Path>) -> Result<Mapping, InputError> {
    path.map_or_else(|| Ok(Mapping::default()), Mapping::read)
}

/// CRC-32 of a file, for provenance.
fn crc32_of(path: &Path) -> Result<u32, InputError> {
    let bytes =
        std::fs::read(path).map_err(|e| InputError::new(format!("cannot be read: {e}")).at_file(path))?;
    Ok(kou_estimator::record::crc32(&bytes))
}

/// A number above zero.
pub(super) fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(value),
        _ => Err("allowed: a number above 0".into()),
    }
}
