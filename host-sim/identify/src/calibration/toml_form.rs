//! TOML form of a calibration: the same fields as the binary record, with units in the keys, converting without loss.
//!
//! Every f32 is written with the shortest decimal that returns the same bits, so a file written, read and written
//! again is the same file, and its record the same record.

use std::path::Path;

use kou_estimator::record;
use kou_estimator::{Calibration, CalibrationError, Params, Problem};
use toml::Value;

use kou_records::{InputError, TomlFile};

/// Heading of every written file.
const HEADING: &str = "# Calibration of the leakage estimator. Units stand in the keys; docs/files.md explains every field.\n\
                       # Leakage coefficients are per piston chamber, in (L/min)/MPa.\n";

/// The calibration as text.
///
/// # Errors
/// When a field holds what TOML cannot (never for a calibration that passed its checks).
pub fn to_toml(calibration: &Calibration) -> Result<String, InputError> {
    let mut value =
        Value::try_from(calibration).map_err(|e| InputError::new(format!("cannot be written: {e}")))?;
    shorten(&mut value);
    let mut document = toml::map::Map::new();
    document.insert("schema".into(), Value::Integer(i64::from(record::calibration::SCHEMA)));
    if let Value::Table(table) = value {
        document.extend(table);
    }
    let body = toml::to_string(&document).map_err(|e| InputError::new(format!("cannot be written: {e}")))?;
    Ok(format!("{HEADING}{body}"))
}

/// Replaces every float, an f32 widened to f64, by the shortest decimal that returns the same f32.
fn shorten(value: &mut Value) {
    match value {
        Value::Float(number) => {
            #[allow(clippy::cast_possible_truncation, reason = "the number came from an f32")]
            let single = *number as f32;
            *number = single.to_string().parse().unwrap_or(*number);
        }
        Value::Table(table) => table.iter_mut().for_each(|(_, v)| shorten(v)),
        Value::Array(array) => array.iter_mut().for_each(shorten),
        _ => {}
    }
}

/// Reads a calibration from a TOML file in memory; not yet checked.
///
/// # Errors
/// Missing, unknown or wrongly typed fields, or a schema of another version, with line and column.
pub fn from_toml(file: &TomlFile) -> Result<Calibration, InputError> {
    let mut table: toml::Table = file.parse()?;
    match table.remove("schema") {
        Some(Value::Integer(found)) if found == i64::from(record::calibration::SCHEMA) => {}
        Some(_) => {
            return Err(file
                .error_at("schema", "is not known to this version")
                .with_allowed(record::calibration::SCHEMA));
        }
        None => {
            return Err(InputError::new("has no key `schema`")
                .at_file(file.path())
                .with_allowed(record::calibration::SCHEMA));
        }
    }
    // First for the message with line and column, which a parsed table no longer has.
    match file.parse::<WithSchema>() {
        Ok(whole) => Ok(whole.calibration()),
        Err(error) => Err(error),
    }
}

/// The calibration's fields beside the schema; a struct of its own because `flatten` would lose unknown keys.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct WithSchema {
    #[serde(rename = "schema")]
    _schema: i64,
    machine: kou_estimator::calibration::MachineConfig,
    oil: kou_estimator::model::oil_compression::OilConfig,
    reduced: kou_estimator::model::flow_balance::ReducedConfig,
    law: kou_estimator::model::leakage_law::LawConfig,
    region: kou_estimator::model::calibrated_region::RegionConfig,
    sensor_errors: kou_estimator::calibration::SensorErrors,
    sensor_ranges: kou_estimator::calibration::SensorRanges,
    limits: kou_estimator::calibration::Limits,
    health: kou_estimator::calibration::HealthConfig,
    provenance: kou_estimator::calibration::Provenance,
}

impl WithSchema {
    fn calibration(self) -> Calibration {
        Calibration {
            machine: self.machine,
            oil: self.oil,
            reduced: self.reduced,
            law: self.law,
            region: self.region,
            sensor_errors: self.sensor_errors,
            sensor_ranges: self.sensor_ranges,
            limits: self.limits,
            health: self.health,
            provenance: self.provenance,
        }
    }
}

/// Reads a calibration from a TOML file or from a binary record, told apart by the record's first bytes.
///
/// # Errors
/// As [`from_toml`]; for a record, what is wrong with it.
pub fn read(path: &Path) -> Result<Calibration, InputError> {
    read_with_source(path).map(|(calibration, _)| calibration)
}

fn read_with_source(path: &Path) -> Result<(Calibration, Option<TomlFile>), InputError> {
    let bytes =
        std::fs::read(path).map_err(|e| InputError::new(format!("cannot be read: {e}")).at_file(path))?;
    if bytes.starts_with(&record::calibration::MAGIC) {
        let calibration =
            record::calibration::decode(&bytes).map_err(|e| InputError::new(e.to_string()).at_file(path))?;
        return Ok((calibration, None));
    }
    let file = TomlFile::read(path)?;
    Ok((from_toml(&file)?, Some(file)))
}

/// Reads a calibration and checks it with the estimator's own checks.
///
/// # Errors
/// As [`read`]; besides, the first field that a check refuses, with line, column, value and range.
pub fn read_checked(path: &Path) -> Result<(Calibration, Params), InputError> {
    let (calibration, source) = read_with_source(path)?;
    match Params::new(&calibration) {
        Ok(params) => Ok((calibration, params)),
        Err(error) => Err(located(path, source.as_ref(), error)),
    }
}

fn located(path: &Path, source: Option<&TomlFile>, error: CalibrationError) -> InputError {
    let at = |message: &str| match source {
        Some(file) => file.error_at(error.field, message),
        None => InputError::new(format!("`{}` {message}", error.field)).at_file(path),
    };
    match error.problem {
        Problem::NotFinite => at("is not a finite number"),
        Problem::OutOfRange { value, min, max } => {
            at("is out of range").with_value(value).with_allowed(format!("{min} to {max}"))
        }
        Problem::Inconsistent(why) => at(&format!("is inconsistent: {why}")),
    }
}

/// Writes a calibration: a binary record where the name ends in `.bin`, TOML otherwise.
///
/// # Errors
/// When the file cannot be written.
pub fn write(path: &Path, calibration: &Calibration) -> Result<(), InputError> {
    let bytes = if path.extension().is_some_and(|e| e == "bin") {
        let mut buffer = [0_u8; record::calibration::MAX_LEN];
        let length = record::calibration::encode(calibration, &mut buffer)
            .map_err(|e| InputError::new(e.to_string()))?;
        buffer.iter().copied().take(length).collect()
    } else {
        to_toml(calibration)?.into_bytes()
    };
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder)
            .map_err(|e| InputError::new(format!("its folder cannot be made: {e}")).at_file(path))?;
    }
    std::fs::write(path, bytes).map_err(|e| InputError::new(format!("cannot be written: {e}")).at_file(path))
}
