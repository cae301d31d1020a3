//! Puts a calibration together: what the machine file says, what was fitted, and the sensors' declared errors.

use kou_estimator::Calibration;
use kou_estimator::calibration::{Limits, MachineConfig, Output, Provenance, SensorErrors, SensorRanges};
use kou_estimator::health::HealthConfig;
use kou_estimator::law::LawConfig;
use kou_estimator::oil::OilConfig;
use kou_estimator::reduced::ReducedConfig;
use kou_estimator::region::RegionConfig;
use kou_estimator::units::{
    Celsius, CubicCentimetre, CubicCentimetrePerRev, LeakageCoefficient, LitrePerMin, Megapascal, Ratio,
    RevPerMin,
};

use kou_lumped::machine::{FlowReceiver, Machine};
use kou_records::InputError;

/// Measurement class of ISO 4409 (permissible systematic errors of instruments).
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum SensorClass {
    /// Class A: speed and flow 0.5 %, pressure 0.5 %, temperature 0.5 K.
    #[value(name = "A")]
    A,
    /// Class B: speed 1 %, flow 1.5 %, pressure 1.5 %, temperature 1 K.
    #[value(name = "B")]
    B,
    /// Class C: speed 2 %, flow 2.5 %, pressure 2.5 %, temperature 2 K.
    #[value(name = "C")]
    C,
}

impl SensorClass {
    /// Permissible systematic errors: speed, flow and pressure relative, temperature in K.
    #[must_use]
    pub const fn permissible(self) -> [f64; 4] {
        match self {
            Self::A => [0.005, 0.005, 0.005, 0.5],
            Self::B => [0.01, 0.015, 0.015, 1.0],
            Self::C => [0.02, 0.025, 0.025, 2.0],
        }
    }
}

/// What the user may say about a calibration besides machine and points.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Serial number of the machine.
    pub serial: String,
    /// Day, as the user wants it to stand in the calibration.
    pub date: String,
    /// Class of the sensors that the controller will use.
    pub class: SensorClass,
    /// CRC-32 of the bench records.
    pub bench_crc32: u32,
    /// CRC-32 of the machine file.
    pub machine_crc32: u32,
}

#[allow(clippy::cast_possible_truncation, reason = "the estimator works in f32")]
const fn single(value: f64) -> f32 {
    value as f32
}

/// The oil of a machine file, for the estimator.
#[must_use]
pub fn oil_config(machine: &Machine) -> OilConfig {
    let oil = machine.oil();
    OilConfig {
        bulk_modulus_mpa: single(oil.bulk_modulus_mpa),
        air_fraction: single(oil.air_fraction),
        heat_capacity_ratio: single(oil.heat_capacity_ratio),
        bulk_modulus_per_k: single(oil.bulk_modulus_per_k),
        reference: Celsius(single(oil.reference_c)),
    }
}

/// Constants of the reduced model by theory: geometry from the machine file, half of all chambers leaking.
#[must_use]
pub fn reduced_config(machine: &Machine) -> ReducedConfig {
    let pump = machine.pump();
    let (motor_dead_cm3, motor_pistons) = match machine.receiver() {
        FlowReceiver::Motor(motor) => (motor.dead_volume_cm3 * motor.pistons as f64, motor.pistons),
        FlowReceiver::FlowMeter(_) => (0.0, 0),
    };
    ReducedConfig {
        pump_displacement: CubicCentimetrePerRev(single(pump.displacement_cm3_per_rev)),
        pump_dead_volume: CubicCentimetre(single(pump.dead_volume_cm3 * pump.pistons as f64)),
        motor_displacement: CubicCentimetrePerRev(single(machine.reference_displacement_cm3_per_rev())),
        motor_dead_volume: CubicCentimetre(single(motor_dead_cm3)),
        leaking_chambers: single((pump.pistons + motor_pistons) as f64 / 2.0),
        fewer_leaking_per_rpm: 0.0,
        fewer_leaking_per_root_mpa: 0.0,
        groove_flow: 0.0,
        case_pressure: Megapascal(single(machine.circuit().case_pressure_mpa)),
    }
}

/// Puts the parts together. Sensor spans and limits follow from the law's normalisers and can be edited afterwards.
///
/// # Errors
/// When a text is too long for the record.
pub fn assemble(
    machine: &Machine,
    reduced: ReducedConfig,
    law: LawConfig,
    region: RegionConfig,
    points: usize,
    settings: &Settings,
) -> Result<Calibration, InputError> {
    let (output, motor_pistons) = match machine.receiver() {
        FlowReceiver::Motor(motor) => (Output::Motor, motor.pistons),
        FlowReceiver::FlowMeter(_) => (Output::FlowMeter, 0),
    };
    let text = |what: &str, value: &str, longest: usize| {
        InputError::new(format!("{what} is too long"))
            .with_value(value)
            .with_allowed(format!("at most {longest} bytes"))
    };
    let health = HealthConfig::for_law(&law);
    let low_pressure = Megapascal(single(machine.circuit().low_pressure_mpa));
    let (n_max, p_max) = (law.n_max.get(), law.p_max.get());
    let [speed, flow, pressure, temperature_k] = settings.class.permissible();
    let other = match output {
        Output::Motor => speed,
        Output::FlowMeter => flow,
    };
    // A permissible error is the half-width of a rectangular distribution: its standard deviation is 1/sqrt 3 of it.
    let standard = |permissible: f64| permissible / 3.0_f64.sqrt();
    let largest_displacement = reduced.pump_displacement.get().max(reduced.motor_displacement.get());
    Ok(Calibration {
        machine: MachineConfig {
            name: machine.name().try_into().map_err(|_| text("the machine's name", machine.name(), 48))?,
            serial: settings
                .serial
                .as_str()
                .try_into()
                .map_err(|_| text("the serial number", &settings.serial, 32))?,
            output,
            pump_pistons: u8::try_from(machine.pump().pistons).unwrap_or(u8::MAX),
            motor_pistons: u8::try_from(motor_pistons).unwrap_or(u8::MAX),
            pump_displacement: CubicCentimetrePerRev(single(machine.pump().displacement_cm3_per_rev)),
            motor_displacement: CubicCentimetrePerRev(single(machine.reference_displacement_cm3_per_rev())),
            low_pressure,
        },
        oil: oil_config(machine),
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
            // Takes the whole flow of the largest speed already at a tenth of the largest pressure: never a leak.
            max_kou: LeakageCoefficient(
                (10.0 * n_max * largest_displacement / 1000.0 / (reduced.leaking_chambers * p_max))
                    .clamp(1e-3, 100.0),
            ),
        },
        health,
        provenance: Provenance {
            tool: concat!("host-sim ", env!("CARGO_PKG_VERSION")).try_into().unwrap_or_default(),
            date: settings.date.as_str().try_into().map_err(|_| text("the date", &settings.date, 16))?,
            bench_crc32: settings.bench_crc32,
            machine_crc32: settings.machine_crc32,
            points: u32::try_from(points).unwrap_or(u32::MAX),
        },
    })
}
