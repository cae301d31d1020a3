//! Recursive least squares for four parameters with the covariance factored as `P = U D U'`.
//!
//! Measurement update by Bierman's UD algorithm (Bierman 1977, Factorization Methods for Discrete Sequential
//! Estimation, ch. V.3). The factored form cannot lose symmetry or positive definiteness to rounding. Forgetting acts
//! on the first parameter only: `U` is unit upper triangular, so its first column is the first unit vector, and adding
//! `q` to `D_1` adds `q` to the first variance and changes nothing else. Thus a parameter that may change (the level)
//! is forgotten, constants (a sensor's offset) are not, and there is no covariance wind-up without excitation. Derived
//! in `docs/health/theory.md`.

use serde::{Deserialize, Serialize};

use super::tuning::D_MIN;

/// Number of parameters: level, ratio offset, slopes with pressure and with temperature.
pub const PARAMETERS: usize = 4;

/// Parameter estimate with its factored covariance.
#[doc(alias = "Bierman")]
#[doc(alias = "UD factorisation")]
#[doc(alias = "recursive least squares")]
#[doc(alias = "RLS")]
#[doc(alias = "Kalman filter")]
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct UdFilter {
    theta: [f32; PARAMETERS],
    d: [f32; PARAMETERS],
    /// Columns of `U` above its diagonal: `u12`; `u13`, `u23`; `u14`, `u24`, `u34`.
    u2: f32,
    u3: [f32; 2],
    u4: [f32; 3],
}

/// Innovation of one measurement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Innovation {
    /// Measured minus predicted value.
    pub error: f32,
    /// Its predicted variance.
    pub variance: f32,
}

impl UdFilter {
    /// Filter with independent parameters of these values and variances.
    #[must_use]
    pub const fn new(theta: [f32; PARAMETERS], variances: [f32; PARAMETERS]) -> Self {
        Self { theta, d: variances, u2: 0.0, u3: [0.0; 2], u4: [0.0; 3] }
    }

    /// Parameter estimate.
    #[must_use]
    pub const fn theta(&self) -> [f32; PARAMETERS] {
        self.theta
    }

    /// Variances of the parameters: the diagonal of `U D U'`.
    #[must_use]
    pub fn variances(&self) -> [f32; PARAMETERS] {
        let [d1, d2, d3, d4] = self.d;
        let u12 = self.u2;
        let [u13, u23] = self.u3;
        let [u14, u24, u34] = self.u4;
        [
            d1 + u12 * u12 * d2 + u13 * u13 * d3 + u14 * u14 * d4,
            d2 + u23 * u23 * d3 + u24 * u24 * d4,
            d3 + u34 * u34 * d4,
            d4,
        ]
    }

    /// Innovation of a measurement `z = phi' theta + noise`, without updating.
    #[must_use]
    pub fn innovation(&self, phi: [f32; PARAMETERS], z: f32, noise_variance: f32) -> Innovation {
        let [f1, f2, f3, f4] = self.factored(phi);
        let [d1, d2, d3, d4] = self.d;
        Innovation {
            error: z - self.predict(phi),
            variance: noise_variance + d1 * f1 * f1 + d2 * f2 * f2 + d3 * f3 * f3 + d4 * f4 * f4,
        }
    }

    /// Predicted measurement `phi' theta`.
    #[must_use]
    pub fn predict(&self, [p1, p2, p3, p4]: [f32; PARAMETERS]) -> f32 {
        let [t1, t2, t3, t4] = self.theta;
        p1 * t1 + p2 * t2 + p3 * t3 + p4 * t4
    }

    /// Updates with a measurement `z = phi' theta + noise`; `noise_variance` must be positive (Bierman 1977, ch. V.3).
    pub fn update(&mut self, phi: [f32; PARAMETERS], z: f32, noise_variance: f32) {
        let error = z - self.predict(phi);
        let [f1, f2, f3, f4] = self.factored(phi);
        let [d1, d2, d3, d4] = self.d;
        let [v1, v2, v3, v4] = [d1 * f1, d2 * f2, d3 * f3, d4 * f4];
        // Innovation variance, accumulated over the directions.
        let a1 = noise_variance + v1 * f1;
        let a2 = a1 + v2 * f2;
        let a3 = a2 + v3 * f3;
        let a4 = a3 + v4 * f4;
        // Unscaled gain, likewise; each column of U is updated with the gain of the columns before it.
        let u12 = self.u2;
        self.u2 = u12 - f2 / a1 * v1;
        let [g1, g2] = [v1 + u12 * v2, v2];
        let [u13, u23] = self.u3;
        let lambda = -f3 / a2;
        self.u3 = [u13 + lambda * g1, u23 + lambda * g2];
        let [g1, g2, g3] = [g1 + u13 * v3, g2 + u23 * v3, v3];
        let [u14, u24, u34] = self.u4;
        let lambda = -f4 / a3;
        self.u4 = [u14 + lambda * g1, u24 + lambda * g2, u34 + lambda * g3];
        let [g1, g2, g3, g4] = [g1 + u14 * v4, g2 + u24 * v4, g3 + u34 * v4, v4];
        // Comparisons, since `max` would be a function call.
        let bounded = |d: f32| if d > D_MIN { d } else { D_MIN };
        self.d = [
            bounded(d1 * noise_variance / a1),
            bounded(d2 * a1 / a2),
            bounded(d3 * a2 / a3),
            bounded(d4 * a3 / a4),
        ];
        let gain = error / a4;
        let [t1, t2, t3, t4] = self.theta;
        self.theta = [t1 + g1 * gain, t2 + g2 * gain, t3 + g3 * gain, t4 + g4 * gain];
    }

    /// Forgets part of the first parameter: its variance grows by `variance`, up to `largest`.
    pub fn forget_first(&mut self, variance: f32, largest: f32) {
        let [first, ..] = self.variances();
        let [d1, ..] = &mut self.d;
        let room = if largest > first { largest - first } else { 0.0 };
        *d1 += if variance < room { variance } else { room };
    }

    /// Replaces the parameters and leaves the covariance.
    pub fn set_theta(&mut self, theta: [f32; PARAMETERS]) {
        self.theta = theta;
    }

    /// Whether parameters and factors are finite and the covariance is positive definite.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        let factors = [&self.u2].into_iter().chain(&self.u3).chain(&self.u4).chain(&self.theta);
        self.d.iter().all(|d| *d > 0.0 && d.is_finite()) && factors.into_iter().all(|f| f.is_finite())
    }

    /// Clamps the parameters to bounds.
    pub fn clamp(&mut self, bounds: [(f32, f32); PARAMETERS]) {
        for (value, (low, high)) in self.theta.iter_mut().zip(bounds) {
            *value = value.clamp(low, high);
        }
    }

    /// Regressor in the factored basis, `f = U' phi`.
    #[inline(always)]
    fn factored(&self, [p1, p2, p3, p4]: [f32; PARAMETERS]) -> [f32; PARAMETERS] {
        let [u13, u23] = self.u3;
        let [u14, u24, u34] = self.u4;
        [p1, self.u2 * p1 + p2, u13 * p1 + u23 * p2 + p3, u14 * p1 + u24 * p2 + u34 * p3 + p4]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracle: a covariance filter in f64, Joseph form.
    struct Joseph {
        theta: [f64; 4],
        p: [[f64; 4]; 4],
    }

    impl Joseph {
        fn update(&mut self, phi: [f64; 4], z: f64, r: f64) {
            let pf: [f64; 4] = core::array::from_fn(|i| (0..4).map(|j| self.p[i][j] * phi[j]).sum());
            let s: f64 = r + (0..4).map(|i| phi[i] * pf[i]).sum::<f64>();
            let k = pf.map(|v| v / s);
            let e = z - (0..4).map(|i| phi[i] * self.theta[i]).sum::<f64>();
            for (theta, k) in self.theta.iter_mut().zip(k) {
                *theta += k * e;
            }
            let a: [[f64; 4]; 4] = core::array::from_fn(|i| {
                core::array::from_fn(|j| f64::from(u8::from(i == j)) - k[i] * phi[j])
            });
            let ap: [[f64; 4]; 4] = core::array::from_fn(|i| {
                core::array::from_fn(|j| (0..4).map(|m| a[i][m] * self.p[m][j]).sum())
            });
            self.p = core::array::from_fn(|i| {
                core::array::from_fn(|j| (0..4).map(|m| ap[i][m] * a[j][m]).sum::<f64>() + r * k[i] * k[j])
            });
        }
    }

    #[test]
    fn val_ud_filter_agrees_with_a_joseph_form_filter_in_f64() {
        let variances = [0.01, 5e-5, 0.01, 0.01];
        let mut ud = UdFilter::new([0.0; 4], variances);
        let mut reference = Joseph {
            theta: [0.0; 4],
            p: core::array::from_fn(|i| {
                core::array::from_fn(|j| if i == j { f64::from(variances[i]) } else { 0.0 })
            }),
        };
        for i in 0..5000_u32 {
            let x = |k: u32| f64::from((i * k + i * i * 7) % 101) / 101.0;
            let phi = [0.02 + 0.05 * x(13), 0.9 + 0.1 * x(29), 0.03 * (x(31) - 0.5), 0.04 * (x(43) - 0.5)];
            let z = 0.03 * phi[0] + 0.004 * phi[1] - 0.02 * phi[2] + 0.03 * phi[3] + 1e-3 * (x(17) - 0.5);
            ud.forget_first(1e-6, 0.04);
            reference.p[0][0] += 1e-6;
            ud.update(phi.map(|v| v as f32), z as f32, 1e-5);
            reference.update(phi, z, 1e-5);
            assert!(ud.variances().iter().all(|v| *v > 0.0));
        }
        for (got, wanted) in ud.theta().iter().zip(reference.theta) {
            // f32 against f64 over 5000 updates of a system whose parameters are of order 0.01.
            assert!((f64::from(*got) - wanted).abs() < 2e-4, "{got} {wanted}");
        }
        for (i, got) in ud.variances().iter().enumerate() {
            let wanted = reference.p[i][i];
            assert!((f64::from(*got) / wanted - 1.0).abs() < 0.02, "{i}: {got} {wanted}");
        }
    }

    #[test]
    fn forgetting_touches_the_first_variance_only_and_is_bounded() {
        let mut ud = UdFilter::new([0.0; 4], [0.01, 5e-5, 0.01, 0.01]);
        for i in 0..50_u8 {
            ud.update(
                [0.05, 1.0, 0.01 * (f32::from(i % 5) - 2.0), 0.01 * (f32::from(i % 7) - 3.0)],
                0.001,
                1e-5,
            );
        }
        let before = ud.variances();
        ud.forget_first(1e-3, 1.0);
        let after = ud.variances();
        assert!((after[0] - before[0] - 1e-3).abs() < 1e-8);
        assert_eq!(before[1..], after[1..]);
        for _ in 0..1000 {
            ud.forget_first(1e-3, 0.04);
        }
        assert!((ud.variances()[0] - 0.04).abs() < 1e-6);
    }

    #[test]
    fn variances_stay_above_their_bound_however_much_is_learned() {
        let mut ud = UdFilter::new([0.0; 4], [0.01, 5e-5, 0.01, 0.01]);
        for i in 0..200_000_u32 {
            let x = |k: u32| ((i * k) % 101) as f32 / 101.0 - 0.5;
            ud.update([0.05 + 0.02 * x(13), 1.0 + 0.1 * x(29), 0.05 * x(31), 0.05 * x(43)], 0.001, 1e-9);
        }
        assert!(ud.is_sound());
        // The last parameter's variance is the last factor alone.
        assert!(ud.variances().iter().all(|v| *v >= D_MIN), "{:?}", ud.variances());
    }
}
