//! Calibration files: the TOML form and the binary record, which convert into each other without loss.
//!
//! The TOML form has the fields of the binary record, with units in the keys. Every f32 is written as the shortest decimal
//! that parses to the same bits, so that a file that is read and written again stays identical byte for byte.

use std::path::Path;

use kou_estimator::record;
use kou_estimator::{Calibration, CalibrationError, Params, Problem};
use toml::Value;

use crate::input_error::InputError;
use crate::toml_file::TomlFile;

/// Comment at the top of every TOML calibration.
const HEADING: &str = "# Calibration of the leakage estimator. Units stand in the keys; docs/files.md explains every field.\n\
                       # Leakage coefficients are per piston chamber, in (L/min)/MPa.\n";

/// Second spellings that are read besides the keys that are written: table, textbook term, key of the format.
const SYNONYMS: [(&str, &str, &str); 3] = [
    ("health", "false_alarm_interval_h", "run_length_h"),
    ("law", "covariance_factor", "error_root"),
    ("law.error_root", "remainder", "rest"),
];

/// TOML form of a calibration.
///
/// # Errors
/// A field that TOML cannot represent; never for a valid calibration.
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

/// Replaces every float, an f32 widened to f64, by the shortest decimal of that f32.
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

/// Parses a calibration from TOML, without the estimator's checks.
///
/// # Errors
/// Missing, unknown or wrongly typed fields, or an unsupported schema, with line and column.
pub fn from_toml(file: &TomlFile) -> Result<Calibration, InputError> {
    let file = &with_format_keys(file)?;
    let mut table: toml::Table = file.parse()?;
    match table.remove("schema") {
        Some(Value::Integer(found)) if found == i64::from(record::calibration::SCHEMA) => {}
        Some(_) => {
            return Err(file
                .error_at("schema", "is not supported by this version")
                .with_allowed(record::calibration::SCHEMA));
        }
        None => {
            return Err(InputError::new("has no key `schema`")
                .at_file(file.path())
                .with_allowed(record::calibration::SCHEMA));
        }
    }
    // From the text, not from the table: only the text has lines and columns for error messages.
    file.parse::<CalibrationToml>().map(CalibrationToml::calibration)
}

/// The file with every synonym replaced by the key of the format.
fn with_format_keys(file: &TomlFile) -> Result<TomlFile, InputError> {
    SYNONYMS
        .iter()
        .try_fold(file.clone(), |file, (table, synonym, key)| file.with_spelling(table, synonym, key))
}

/// Schema and fields of a calibration; a separate struct because serde's `flatten` accepts unknown keys.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct CalibrationToml {
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

impl CalibrationToml {
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

/// Reads a calibration, TOML or binary record; a record is recognised by its first bytes. Without the estimator's checks.
///
/// # Errors
/// As [`from_toml`]; for a record, its decoding error.
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
    let file = with_format_keys(&TomlFile::read(path)?)?;
    Ok((from_toml(&file)?, Some(file)))
}

/// Reads a calibration and validates it with the estimator's checks.
///
/// # Errors
/// As [`read`], and the first invalid field, with line, column, value and range.
pub fn read_checked(path: &Path) -> Result<(Calibration, Params), InputError> {
    let (calibration, source) = read_with_source(path)?;
    match Params::new(&calibration) {
        Ok(params) => Ok((calibration, params)),
        Err(error) => Err(located(path, source.as_ref(), error)),
    }
}

fn located(path: &Path, source: Option<&TomlFile>, error: CalibrationError) -> InputError {
    let field_error = |message: &str| match source {
        Some(file) => file.error_at(error.field, message),
        None => InputError::new(format!("`{}` {message}", error.field)).at_file(path),
    };
    match error.problem {
        Problem::NotFinite => field_error("is not a finite number"),
        Problem::OutOfRange { value, min, max } => {
            field_error("is out of range").with_value(value).with_allowed(format!("{min} to {max}"))
        }
        Problem::Inconsistent(why) => field_error(&format!("is inconsistent: {why}")),
    }
}

/// Writes a calibration: a binary record if the file name ends in `.bin`, TOML otherwise.
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
            .map_err(|e| InputError::new(format!("its folder cannot be created: {e}")).at_file(path))?;
    }
    std::fs::write(path, bytes).map_err(|e| InputError::new(format!("cannot be written: {e}")).at_file(path))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str) -> Result<Calibration, InputError> {
        from_toml(&TomlFile::from_text(Path::new("c.toml"), text.into()).unwrap())
    }

    #[test]
    fn second_spellings_are_read_as_the_keys_of_the_format() {
        let calibration = kou_fixture::reference();
        let text = to_toml(&calibration).unwrap();
        let mut other = text.clone();
        for (_, synonym, key) in SYNONYMS {
            assert!(other.contains(key), "{key}");
            other = other.replace(&format!("{key} ="), &format!("{synonym} ="));
            other = other.replace(&format!(".{key}]"), &format!(".{synonym}]"));
        }
        assert!(
            !other.contains("run_length_h") && !other.contains("error_root") && !other.contains("\nrest ")
        );
        assert_eq!(parsed(&text), Ok(calibration.clone()));
        assert_eq!(parsed(&other), Ok(calibration));
    }

    #[test]
    fn both_spellings_of_a_key_are_rejected_with_the_line() {
        let text = to_toml(&kou_fixture::reference()).unwrap();
        let both = text.replace("run_length_h =", "false_alarm_interval_h = 1e5\nrun_length_h =");
        let line = 1 + both.lines().position(|line| line.starts_with("false_alarm")).unwrap() as u64;
        let error = parsed(&both).unwrap_err();
        assert_eq!(error.line, Some(line), "{error}");
        assert!(error.to_string().contains("state it once"), "{error}");
    }
}
