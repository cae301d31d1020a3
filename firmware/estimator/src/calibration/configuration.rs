//! Configuration of one machine as it is written and stored.

use heapless::String;
use serde::{Deserialize, Serialize};

use super::health::HealthConfig;
use crate::model::calibrated_region::RegionConfig;
use crate::model::flow_balance::ReducedConfig;
use crate::model::leakage_law::LawConfig;
use crate::model::oil_compression::OilConfig;
use crate::units::{
    Celsius, CubicCentimetrePerRev, LeakageCoefficient, LitrePerMin, Megapascal, Ratio, RevPerMin,
};

/// Sensor of the output flow.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OutputSensor {
    /// A motor: its speed over the pump's is the ratio.
    Motor,
    /// A flow meter in the high line: its flow over that of its reference displacement at pump speed is the ratio.
    FlowMeter,
}

/// Identity of the machine, and its constants that are not fitted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MachineConfig {
    /// Name of the machine's type.
    pub name: String<48>,
    /// Serial number of the calibrated machine; empty where the calibration is for the type.
    pub serial: String<32>,
    /// Sensor of the output flow.
    pub output: OutputSensor,
    /// Number of pistons of the pump, `Z_p`.
    pub pump_pistons: u8,
    /// Number of pistons of the motor, `Z_m`; 0 for a flow meter.
    pub motor_pistons: u8,
    /// Displacement of the pump by its data sheet, `D_p`.
    #[serde(rename = "pump_displacement_cm3_per_rev")]
    pub pump_displacement: CubicCentimetrePerRev,
    /// Displacement of the motor by its data sheet, `D_m`; the reference displacement of a flow meter.
    #[serde(rename = "motor_displacement_cm3_per_rev")]
    pub motor_displacement: CubicCentimetrePerRev,
    /// Pressure of the low line where it is not measured, gauge.
    #[serde(rename = "low_pressure_mpa")]
    pub low_pressure: Megapascal,
}

/// Standard errors (1 sigma) of the sensors, for the standard error of the observed coefficient.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorErrors {
    /// Of the speed ratio, relative: both speed sensors together, or flow meter and speed sensor.
    pub ratio_relative: f32,
    /// Of the pressure of the high line, relative to the reading.
    pub high_pressure_relative: f32,
    /// Of the oil temperature.
    #[serde(rename = "oil_temperature_k")]
    pub oil_temperature: Celsius,
    /// Of the displacement fraction; 0 where full displacement is a mechanical stop.
    pub displacement: Ratio,
}

/// Declared measuring range of every sensor: a value outside is a fault, not a measurement.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorRanges {
    /// Largest magnitude of either shaft's speed; the pump turns in one direction only.
    #[serde(rename = "speed_max_rpm")]
    pub speed_max: RevPerMin,
    /// Smallest pressure, gauge.
    #[serde(rename = "pressure_min_mpa")]
    pub pressure_min: Megapascal,
    /// Largest pressure, gauge.
    #[serde(rename = "pressure_max_mpa")]
    pub pressure_max: Megapascal,
    /// Lowest temperature.
    #[serde(rename = "temperature_min_c")]
    pub temperature_min: Celsius,
    /// Highest temperature.
    #[serde(rename = "temperature_max_c")]
    pub temperature_max: Celsius,
    /// Largest magnitude of flow.
    #[serde(rename = "flow_max_l_min")]
    pub flow_max: LitrePerMin,
}

/// Operating limits within which leakage is estimated.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Limits {
    /// Oldest reading that is used, in microseconds.
    pub max_age_us: u32,
    /// Lowest pump speed at which leakage is estimated.
    #[serde(rename = "min_pump_speed_rpm")]
    pub min_pump_speed: RevPerMin,
    /// Smallest displacement fraction, in magnitude, at which leakage is estimated.
    pub min_displacement: Ratio,
    /// Smallest pressure difference between the lines at which leakage is estimated.
    #[serde(rename = "min_pressure_difference_mpa")]
    pub min_pressure_difference: Megapascal,
    /// Largest plausible leakage coefficient.
    #[serde(rename = "max_kou_l_min_mpa")]
    pub max_kou: LeakageCoefficient,
}

/// Provenance of a calibration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// Tool and version that wrote the calibration.
    pub tool: String<32>,
    /// Date of the calibration, as the user gave it; empty where none was given.
    pub date: String<16>,
    /// CRC-32 of the bench records' bytes.
    pub bench_crc32: u32,
    /// CRC-32 of the machine file's bytes.
    pub machine_crc32: u32,
    /// Number of bench points to which the law was fitted.
    pub points: u32,
}

/// Calibration of one machine, unchecked: everything the estimator knows that is not measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    /// Machine.
    pub machine: MachineConfig,
    /// Oil.
    pub oil: OilConfig,
    /// Constants of the flow balance (reduced model).
    pub reduced: ReducedConfig,
    /// Leakage law.
    pub law: LawConfig,
    /// Region in which the law was calibrated.
    pub region: RegionConfig,
    /// Standard errors of the sensors.
    pub sensor_errors: SensorErrors,
    /// Measuring ranges of the sensors.
    pub sensor_ranges: SensorRanges,
    /// Operating limits within which leakage is estimated.
    pub limits: Limits,
    /// Health monitoring.
    pub health: HealthConfig,
    /// Provenance.
    pub provenance: Provenance,
}
