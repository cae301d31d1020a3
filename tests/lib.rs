//! Helpers of the end-to-end tests: a calibration to test with, its record, and samples to run through it.
//!
//! A test that needs the firmware or QEMU fails where they are missing: a skipped test would look like a passed one.

pub mod samples;

use kou_estimator::calibration::HealthConfig;
use kou_estimator::calibration::{
    Limits, MachineConfig, OutputSensor, Provenance, SensorErrors, SensorRanges,
};
use kou_estimator::model::calibrated_region::RegionConfig;
use kou_estimator::model::flow_balance::ReducedConfig;
use kou_estimator::model::leakage_law::{LawConfig, LawCovarianceFactor};
use kou_estimator::model::oil_compression::OilConfig;
use kou_estimator::record;
use kou_estimator::units::{
    Celsius, CubicCentimetre, CubicCentimetrePerRev, LeakageCoefficient, LitrePerMin, Megapascal, Ratio,
    RevPerMin,
};
use kou_estimator::{Calibration, Params};

use host_sim::pil::{PilError, PilOptions};

/// Text from a literal that is known to fit.
fn text<const N: usize>(literal: &str) -> heapless::String<N> {
    heapless::String::try_from(literal).expect("literal fits its field")
}

/// Calibration of the reference machine: 300 cm3/rev, nine pistons each, and a law that gives 0.03 to 0.16.
#[must_use]
pub fn reference_calibration() -> Calibration {
    let corners = (0..8).map(|corner: u8| {
        let pick = |bit: u8, low: f32, high: f32| if corner & (1 << bit) == 0 { low } else { high };
        [pick(0, 0.3, 1.0), pick(1, 0.15, 1.0), pick(2, 0.3, 1.0)]
    });
    Calibration {
        machine: MachineConfig {
            name: text("reference 300"),
            serial: text("e2e-1"),
            output: OutputSensor::Motor,
            pump_pistons: 9,
            motor_pistons: 9,
            pump_displacement: CubicCentimetrePerRev(300.0),
            motor_displacement: CubicCentimetrePerRev(300.0),
            low_pressure: Megapascal(1.5),
        },
        oil: OilConfig {
            bulk_modulus_mpa: 1314.0,
            air_fraction: 0.002,
            heat_capacity_ratio: 1.4,
            bulk_modulus_per_k: -0.002,
            reference: Celsius(60.0),
        },
        reduced: ReducedConfig {
            pump_displacement: CubicCentimetrePerRev(301.2),
            pump_dead_volume: CubicCentimetre(90.36),
            motor_displacement: CubicCentimetrePerRev(300.0),
            motor_dead_volume: CubicCentimetre(90.0),
            leaking_chambers: 8.7,
            fewer_leaking_per_rpm: 6e-5,
            fewer_leaking_per_root_mpa: 0.02,
            groove_flow: 0.01,
            case_pressure: Megapascal(0.0),
        },
        law: LawConfig {
            a11: 0.008,
            a22: -0.006,
            a33: 0.021,
            a12: 0.004,
            a13: 0.011,
            a23: -0.003,
            b1: 0.035,
            b2: 0.013,
            b3: 0.042,
            c: 0.012,
            n_max: RevPerMin(2800.0),
            p_max: Megapascal(50.0),
            t_max: Celsius(90.0),
            residual_se: LeakageCoefficient(0.0015),
            covariance_factor: LawCovarianceFactor {
                first: [1e-3; 10],
                third: [5e-4; 8],
                ..LawCovarianceFactor::ZERO
            },
        },
        region: RegionConfig::around(corners, 0.01),
        sensor_errors: SensorErrors {
            ratio_relative: 0.0005,
            high_pressure_relative: 0.004,
            oil_temperature: Celsius(1.0),
            displacement: Ratio(0.001),
        },
        sensor_ranges: SensorRanges {
            speed_max: RevPerMin(3500.0),
            pressure_min: Megapascal(0.0),
            pressure_max: Megapascal(60.0),
            temperature_min: Celsius(-40.0),
            temperature_max: Celsius(150.0),
            flow_max: LitrePerMin(1200.0),
        },
        limits: Limits {
            max_age_us: 100_000,
            min_pump_speed: RevPerMin(300.0),
            min_displacement: Ratio(0.2),
            min_pressure_difference: Megapascal(3.0),
            max_kou: LeakageCoefficient(1.0),
        },
        health: HealthConfig {
            rated_speed: RevPerMin(2000.0),
            rated_pressure: Megapascal(30.0),
            rated_temperature: Celsius(55.0),
            ..HealthConfig::DEFAULT
        },
        provenance: Provenance {
            tool: text("end-to-end test"),
            date: text(""),
            bench_crc32: 0,
            machine_crc32: 0,
            points: 45,
        },
    }
}

/// The binary record of a calibration.
#[must_use]
pub fn record_of(calibration: &Calibration) -> Vec<u8> {
    let mut bytes = vec![0; record::calibration::MAX_LEN];
    let len = record::calibration::encode(calibration, &mut bytes).expect("every calibration fits a record");
    bytes.truncate(len);
    bytes
}

/// Checked parameters of [`reference_calibration`].
#[must_use]
pub fn reference_params() -> Params {
    Params::new(&reference_calibration()).expect("the reference calibration passes every check")
}

/// The value of a run through QEMU, or a failure that tells how to set the tests up.
#[track_caller]
pub fn set_up<T>(result: Result<T, PilError>) -> T {
    match result {
        Ok(value) => value,
        Err(error @ (PilError::QemuMissing { .. } | PilError::FirmwareMissing { .. })) => {
            panic!("{error}\n`cargo xtask test` does this and then runs all tests")
        }
        Err(error) => panic!("{error}"),
    }
}

/// Options for the tests: those that `host-sim` has by default.
#[must_use]
pub fn pil_options() -> PilOptions {
    PilOptions::default()
}
