//! A calibration of the reference machine and an independent f64 statement of the reduced model, shared by the tests.
#![allow(dead_code, reason = "each test binary uses its own part")]

use kou_estimator::calibration::HealthConfig;
use kou_estimator::calibration::{
    Limits, MachineConfig, OutputSensor, Provenance, SensorErrors, SensorRanges,
};
use kou_estimator::model::calibrated_region::RegionConfig;
use kou_estimator::model::flow_balance::ReducedConfig;
use kou_estimator::model::leakage_law::{LawConfig, LawCovarianceFactor};
use kou_estimator::model::oil_compression::OilConfig;
use kou_estimator::units::*;
use kou_estimator::{Calibration, Reading, Sample};

/// Reference machine with a law of plausible size.
pub fn calibration() -> Calibration {
    Calibration {
        machine: MachineConfig {
            name: "reference".try_into().unwrap(),
            serial: "0001".try_into().unwrap(),
            output: OutputSensor::Motor,
            pump_pistons: 9,
            motor_pistons: 9,
            pump_displacement: CubicCentimetrePerRev(301.2),
            motor_displacement: CubicCentimetrePerRev(300.0),
            low_pressure: Megapascal(1.5),
        },
        oil: OilConfig {
            bulk_modulus_mpa: 1314.0,
            air_fraction: 0.002,
            heat_capacity_ratio: 1.4,
            bulk_modulus_per_k: 0.0,
            reference: Celsius(60.0),
        },
        reduced: ReducedConfig {
            pump_displacement: CubicCentimetrePerRev(301.2),
            pump_dead_volume: CubicCentimetre(0.3 * 301.2),
            motor_displacement: CubicCentimetrePerRev(300.0),
            motor_dead_volume: CubicCentimetre(0.3 * 300.0),
            leaking_chambers: 8.7,
            fewer_leaking_per_rpm: 6e-5,
            fewer_leaking_per_root_mpa: 0.02,
            groove_flow: 0.01,
            case_pressure: Megapascal(0.0),
        },
        law: LawConfig {
            a11: 0.01,
            a22: 0.005,
            a33: 0.03,
            a12: 0.002,
            a13: 0.02,
            a23: -0.004,
            b1: 0.02,
            b2: -0.01,
            b3: 0.01,
            c: 0.025,
            n_max: RevPerMin(2800.0),
            p_max: Megapascal(50.0),
            t_max: Celsius(90.0),
            residual_se: LeakageCoefficient(0.002),
            covariance_factor: LawCovarianceFactor {
                first: [1e-3; 10],
                third: [5e-4; 8],
                ..LawCovarianceFactor::ZERO
            },
        },
        region: RegionConfig::around(
            [[0.3, 0.1, 0.3], [1.0, 1.0, 1.0], [0.3, 1.0, 1.0], [1.0, 0.1, 0.3]],
            0.4,
        ),
        sensor_errors: SensorErrors {
            ratio_relative: 5e-4,
            high_pressure_relative: 0.004,
            oil_temperature: Celsius(1.0),
            displacement: Ratio(0.0),
        },
        sensor_ranges: SensorRanges {
            speed_max: RevPerMin(3500.0),
            pressure_min: Megapascal(0.0),
            pressure_max: Megapascal(60.0),
            temperature_min: Celsius(-40.0),
            temperature_max: Celsius(130.0),
            flow_max: LitrePerMin(1200.0),
        },
        limits: Limits {
            max_age_us: 100_000,
            min_pump_speed: RevPerMin(300.0),
            min_displacement: Ratio(0.1),
            min_pressure_difference: Megapascal(3.0),
            max_kou: LeakageCoefficient(2.0),
        },
        health: HealthConfig {
            rated_speed: RevPerMin(2000.0),
            rated_pressure: Megapascal(30.0),
            rated_temperature: Celsius(55.0),
            ..HealthConfig::DEFAULT
        },
        provenance: Provenance {
            tool: "test".try_into().unwrap(),
            date: "2026-01-01".try_into().unwrap(),
            bench_crc32: 1,
            machine_crc32: 2,
            points: 45,
        },
    }
}

/// A good sample of the reference machine under load.
pub fn sample(time_us: u64) -> Sample {
    let time = Micros(time_us);
    let mut sample = Sample::empty(time);
    sample.pump_speed = Reading::new(time, RevPerMin(2000.0));
    sample.motor_speed = Reading::new(time, RevPerMin(1850.0));
    sample.high_pressure = Reading::new(time, Megapascal(30.0));
    sample.oil_temperature = Reading::new(time, Celsius(60.0));
    sample
}

/// The reduced model in f64, by adaptive quadrature and library functions; shares nothing with the crate but numbers.
pub mod reference {
    /// Oil of the f64 reference.
    #[derive(Debug, Clone, Copy)]
    pub struct Oil {
        pub beta_mpa: f64,
        pub air: f64,
        pub lambda: f64,
    }

    impl Oil {
        fn u(&self, p_abs: f64) -> f64 {
            self.air * (0.101_325 / p_abs).powf(1.0 / self.lambda)
        }

        /// 1/beta by the Wylie model as published, not by its integral.
        fn compressibility(&self, p: f64) -> f64 {
            let u = self.u(p);
            (1.0 + u * self.beta_mpa / (self.lambda * p)) / (self.beta_mpa * (1.0 + u))
        }

        /// chi = 1 - rho_L/rho_H with ln(rho_H/rho_L) = integral of dp/beta, gauge pressures.
        pub fn compression_loss(&self, low: f64, high: f64) -> f64 {
            let f = |t: f64| self.compressibility(t.exp()) * t.exp();
            let (a, b) = ((low + 0.101_325).ln(), (high + 0.101_325).ln());
            1.0 - (-simpson(&f, a, b)).exp()
        }
    }

    /// Composite Simpson rule over 4000 intervals of ln p: its error is far below 1e-12 for this smooth integrand.
    fn simpson(f: &dyn Fn(f64) -> f64, a: f64, b: f64) -> f64 {
        let n = 4000;
        let h = (b - a) / f64::from(n);
        let inner: f64 = (1..n).map(|i| f(a + h * f64::from(i)) * if i % 2 == 1 { 4.0 } else { 2.0 }).sum();
        (f(a) + inner + f(b)) * h / 3.0
    }

    /// Machine of the f64 reference.
    #[derive(Debug, Clone, Copy)]
    pub struct Machine {
        pub d_p: f64,
        pub d_m: f64,
        pub dead_p: f64,
        pub dead_m: f64,
        pub chambers: f64,
        pub fewer_per_rpm: f64,
        pub fewer_per_root: f64,
        pub groove: f64,
        pub p_low: f64,
    }

    impl Machine {
        /// Speed ratio by the flow balance, design equation of the reduced model.
        pub fn ratio(&self, chi: f64, n_p: f64, p_h: f64, alpha: f64, kou: f64) -> f64 {
            let swept = alpha.abs() * self.d_p;
            let dead = self.dead_p + self.d_p * (1.0 - alpha.abs()) / 2.0;
            let root = (p_h - self.p_low).sqrt();
            let chambers =
                self.chambers - self.fewer_per_rpm * alpha.abs() * n_p - self.fewer_per_root * root;
            let leak = 1000.0 * (chambers * kou * p_h + self.groove * root) / n_p;
            alpha.signum() * (swept - (swept + dead) * chi - leak) / (self.d_m + self.dead_m * chi)
        }
    }
}
