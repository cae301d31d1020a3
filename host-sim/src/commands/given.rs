//! What several commands are given alike, so that they cannot read it differently.
//!
//! `identify` and `report`: points, machine, and what is known beforehand; one set of options for both, so that the page signed
//! tells of the very fit that the calibration is from. `evaluate` and `verify`: a machine and its calibration.

use std::path::{Path, PathBuf};

use kou_estimator::{Calibration, Params};

use super::Failure;
use kou_identify::calibration::{self, SensorClass, Settings};
use kou_identify::joint::Prior;
use kou_lumped::machine::Machine;
use kou_records::InputError;
use kou_records::Mapping;
use kou_records::{BenchPoint, read_bench, without_repeats};

/// Bench points, machine and prior knowledge.
#[derive(Debug, clap::Args)]
pub struct Given {
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
    /// Day of the bench test, as it shall stand in the calibration.
    #[arg(long, default_value = "")]
    pub date: String,
    /// ISO 4409 class of the sensors on the controller, for the standard error of the coefficient seen.
    #[arg(long, value_enum, default_value = "A")]
    pub class: SensorClass,
}

/// The same, read and checked.
#[derive(Debug)]
pub struct Read {
    /// The machine.
    pub machine: Machine,
    /// The points, each once.
    pub points: Vec<BenchPoint>,
    /// Rows that repeat another one, with that one's line.
    pub repeated: Vec<(BenchPoint, u64)>,
    /// What the calibration says of its origin.
    pub settings: Settings,
    /// What is known beforehand.
    pub prior: Prior,
}

impl Given {
    /// Reads the files.
    ///
    /// # Errors
    /// A file that cannot be read or says something impossible.
    pub fn read(&self) -> Result<Read, Failure> {
        let machine = Machine::load(&self.machine)?;
        let points = read_bench(
            &self.bench,
            &mapping(self.map.as_deref())?,
            machine.reference_displacement_cm3_per_rev(),
        )?;
        let (points, repeated) = without_repeats(points);
        let settings = Settings {
            serial: self.serial.clone(),
            date: self.date.clone(),
            class: self.class,
            bench_crc32: crc32_of(&self.bench)?,
            machine_crc32: crc32_of(&self.machine)?,
        };
        let prior = Prior {
            bulk: self.bulk_uncertainty,
            displacement: self.displacement_uncertainty,
            ratio: self.ratio_error,
            ..Prior::default()
        };
        Ok(Read { machine, points, repeated, settings, prior })
    }
}

/// A machine and its calibration.
#[derive(Debug, clap::Args)]
pub struct Calibrated {
    /// Machine file (TOML); it must be the calibration's.
    #[arg(long, value_name = "M.toml")]
    pub machine: PathBuf,
    /// Calibration: TOML or binary record.
    #[arg(long, value_name = "CAL.toml")]
    pub calibration: PathBuf,
}

impl Calibrated {
    /// Reads the files; the calibration also as the estimator takes it.
    ///
    /// # Errors
    /// A file that cannot be read or says something impossible, a calibration that the controller would refuse or that is
    /// of another type of machine.
    pub fn read(&self) -> Result<(Machine, Calibration, Params), Failure> {
        let machine = Machine::load(&self.machine)?;
        let (calibration, params) = calibration::read_checked(&self.calibration)?;
        if calibration.machine.name.as_str() != machine.name() {
            let error = InputError::new("is of another machine than the machine file")
                .at_file(&self.calibration)
                .with_value(&calibration.machine.name)
                .with_allowed(machine.name());
            return Err(error.into());
        }
        Ok((machine, calibration, params))
    }
}

/// Reads a mapping file, if one is named.
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
