//! Assembly of a calibration from machine parameters, fitted law and surrogate, and declared sensor errors.

use kou_estimator::Calibration;
use kou_estimator::calibration::HealthConfig;
use kou_estimator::calibration::{
    Limits, MachineConfig, OutputSensor, Provenance, SensorErrors, SensorRanges,
};
use kou_estimator::model::calibrated_region::RegionConfig;
use kou_estimator::model::flow_balance::ReducedConfig;
use kou_estimator::model::leakage_law::LawConfig;
use kou_estimator::units::{
    Celsius, CubicCentimetrePerRev, LeakageCoefficient, LitrePerMin, Megapascal, Ratio, RevPerMin,
};
use kou_records::InputError;

use crate::convert::single;
use crate::machine_parameters::{MachineParameters, RatioReference};
use crate::sensor_class::SensorClass;

/// Provenance and sensor class of a calibration.
#[derive(Debug, Clone)]
pub struct CalibrationSettings {
    /// Serial number of the machine on the bench.
    pub serial: String,
    /// Date of the bench test, as free text.
    pub date: String,
    /// Measurement class of the controller's sensors.
    pub class: SensorClass,
    /// CRC-32 of the bench records.
    pub bench_crc32: u32,
    /// CRC-32 of the machine file.
    pub machine_crc32: u32,
}

/// Assembles a calibration. Sensor ranges and limits are derived from the law's normalisers and can be edited in the file.
///
/// # Errors
/// A text that is too long for the record.
pub fn assemble(
    machine: &MachineParameters,
    reduced: ReducedConfig,
    law: LawConfig,
    region: RegionConfig,
    points: usize,
    settings: &CalibrationSettings,
) -> Result<Calibration, InputError> {
    let (output, motor_pistons) = match machine.reference {
        RatioReference::Motor(motor) => (OutputSensor::Motor, motor.pistons),
        RatioReference::FlowMeter { .. } => (OutputSensor::FlowMeter, 0),
    };
    let too_long = |what: &str, value: &str, longest: usize| {
        InputError::new(format!("{what} is too long"))
            .with_value(value)
            .with_allowed(format!("at most {longest} bytes"))
    };
    let health = HealthConfig::for_law(&law);
    let low_pressure = Megapascal(single(machine.low_pressure_mpa));
    let (n_max, p_max) = (law.n_max.get(), law.p_max.get());
    let [speed, flow, pressure, temperature_k] = settings.class.permissible();
    let other = match output {
        OutputSensor::Motor => speed,
        OutputSensor::FlowMeter => flow,
    };
    // Rectangular distribution with the permissible error as half-width: its standard deviation is 1/sqrt 3 of that
    // (JCGM 100:2008, 4.3.7).
    let standard = |permissible: f64| permissible / 3.0_f64.sqrt();
    let largest_displacement = reduced.pump_displacement.get().max(reduced.motor_displacement.get());
    Ok(Calibration {
        machine: MachineConfig {
            name: machine
                .name
                .as_str()
                .try_into()
                .map_err(|_| too_long("the machine's name", &machine.name, 48))?,
            serial: settings
                .serial
                .as_str()
                .try_into()
                .map_err(|_| too_long("the serial number", &settings.serial, 32))?,
            output,
            pump_pistons: u8::try_from(machine.pump.pistons).unwrap_or(u8::MAX),
            motor_pistons: u8::try_from(motor_pistons).unwrap_or(u8::MAX),
            pump_displacement: CubicCentimetrePerRev(single(machine.pump.displacement_cm3_per_rev)),
            motor_displacement: CubicCentimetrePerRev(single(machine.reference_displacement_cm3_per_rev())),
            low_pressure,
        },
        oil: machine.oil_config(),
        reduced,
        law,
        region,
        sensor_errors: SensorErrors {
            ratio_relative: single(standard(speed).hypot(standard(other))),
            high_pressure_relative: single(standard(pressure)),
            oil_temperature: Celsius(single(standard(temperature_k))),
            displacement: Ratio(0.0),
        },
        sensor_ranges: SensorRanges {
            speed_max: RevPerMin(1.25 * n_max),
            pressure_min: Megapascal(low_pressure.get().min(0.0)),
            pressure_max: Megapascal((1.25 * p_max).min(120.0)),
            temperature_min: Celsius(-40.0),
            temperature_max: Celsius(130.0),
            flow_max: LitrePerMin(1.25 * n_max * largest_displacement / 1000.0),
        },
        limits: Limits {
            max_age_us: 500_000,
            min_pump_speed: RevPerMin(0.1 * n_max),
            min_displacement: Ratio(0.1),
            min_pressure_difference: Megapascal((0.05 * p_max).max(0.2)),
            // This leakage consumes the whole flow at the maximum speed and a tenth of the maximum pressure.
            max_kou: LeakageCoefficient(
                (10.0 * n_max * largest_displacement / 1000.0 / (reduced.leaking_chambers * p_max))
                    .clamp(1e-3, 100.0),
            ),
        },
        health,
        provenance: Provenance {
            tool: concat!("host-sim ", env!("CARGO_PKG_VERSION")).try_into().unwrap_or_default(),
            date: settings.date.as_str().try_into().map_err(|_| too_long("the date", &settings.date, 16))?,
            bench_crc32: settings.bench_crc32,
            machine_crc32: settings.machine_crc32,
            points: u32::try_from(points).unwrap_or(u32::MAX),
        },
    })
}
