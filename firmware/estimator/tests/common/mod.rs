//! A calibration of the reference machine and an independent f64 statement of the reduced model, shared by the tests.
#![allow(dead_code, reason = "each test binary uses its own part")]

pub use kou_fixture::wide_envelope as calibration;

use kou_estimator::units::{Celsius, Megapascal, Micros, RevPerMin};
use kou_estimator::{Reading, Sample};

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
    pub struct OracleMachine {
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

    impl OracleMachine {
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
