//! Leakage law: the leakage coefficient as a quadratic in normalised pump speed, pressure and oil temperature.
//!
//! With `x = n_p/n_max`, `y = p_H/p_max`, `z = T_b/T_max` (Wang et al. 2025, eqs. 4, 17 and 18):
//!
//! ```text
//! Kou = a11 x^2 + a22 y^2 + a33 z^2 + a12 xy + a13 xz + a23 yz + b1 x + b2 y + b3 z + c
//! ```
//!
//! `docs/law.md` derives it and gives the conversion to physical coefficients.

use serde::{Deserialize, Serialize};

use crate::model::sqrt::square_root;
use crate::units::{Celsius, LeakageCoefficient, Megapascal, RevPerMin};

/// Coefficients and normalisers as written in a calibration. All coefficients are in (L/min)/MPa.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LawConfig {
    /// Of x^2.
    pub a11: f32,
    /// Of y^2.
    pub a22: f32,
    /// Of z^2.
    pub a33: f32,
    /// Of xy.
    pub a12: f32,
    /// Of xz.
    pub a13: f32,
    /// Of yz.
    pub a23: f32,
    /// Of x.
    pub b1: f32,
    /// Of y.
    pub b2: f32,
    /// Of z.
    pub b3: f32,
    /// Constant term.
    pub c: f32,
    /// Normaliser of pump speed.
    #[serde(rename = "n_max_rpm")]
    pub n_max: RevPerMin,
    /// Normaliser of pressure, gauge.
    #[serde(rename = "p_max_mpa")]
    pub p_max: Megapascal,
    /// Normaliser of oil temperature.
    #[serde(rename = "t_max_c")]
    pub t_max: Celsius,
    /// Misfit of the law: root mean square residual of the fit, per degree of freedom.
    #[serde(rename = "residual_se")]
    pub residual_se: LeakageCoefficient,
    /// Covariance of the ten coefficients, as a factor.
    #[serde(rename = "error_root")]
    pub covariance_factor: LawCovarianceFactor,
}

/// Low-rank factor `R` of the coefficients' covariance, `R^T R` plus a remainder.
///
/// `R` has four rows, upper trapezoidal, from the diagonal on, in (L/min)/MPa. Order of the terms: 1, x, y, z, x^2,
/// y^2, z^2, xy, xz, yz. With `phi` these ten at an operating point, `|R phi|^2 + remainder^2` is the variance of the
/// law due to its coefficients: the effect of uncertain displacement ratio, bulk modulus and bench sensors on the fit.
/// Ten rows would be exact and cost a third of a step; `docs/law.md` states how the four are chosen.
#[doc(alias = "square-root covariance")]
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LawCovarianceFactor {
    /// First row: all ten terms.
    pub first: [f32; 10],
    /// Second row: from x on.
    pub second: [f32; 9],
    /// Third row: from y on.
    pub third: [f32; 8],
    /// Fourth row: from z on.
    pub fourth: [f32; 7],
    /// Largest standard error within the region that the four rows do not represent.
    #[serde(rename = "rest")]
    pub remainder: LeakageCoefficient,
}

impl LawCovarianceFactor {
    /// Covariance zero: coefficients that are known exactly.
    pub const ZERO: Self = Self {
        first: [0.0; 10],
        second: [0.0; 9],
        third: [0.0; 8],
        fourth: [0.0; 7],
        remainder: LeakageCoefficient(0.0),
    };

    /// Rows, the longest first.
    #[must_use]
    pub const fn rows(&self) -> [&[f32]; 4] {
        [&self.first, &self.second, &self.third, &self.fourth]
    }

    /// `|R phi|^2`.
    #[inline(always)]
    fn variance(&self, phi: &[f32; 10]) -> f32 {
        fn squared<const N: usize>(row: &[f32; N], phi: &[f32; 10]) -> f32 {
            // The row's last entry belongs to the last term, so both are paired from their ends.
            let sum = row.iter().rev().zip(phi.iter().rev()).fold(0.0, |sum, (r, f)| sum + r * f);
            sum * sum
        }
        squared(&self.first, phi)
            + squared(&self.second, phi)
            + squared(&self.third, phi)
            + squared(&self.fourth, phi)
    }
}

/// Leakage law prepared for evaluation. Constructed by [`crate::Params::new`] only, so its numbers have been checked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Law {
    config: LawConfig,
    /// Variance common to all operating points: misfit and remainder of the covariance.
    common_variance: f32,
    per_n_max: f32,
    per_p_max: f32,
    per_t_max: f32,
}

impl Law {
    /// Prepares a law from a checked configuration.
    pub(crate) fn from_checked(config: LawConfig) -> Self {
        let (misfit, remainder) = (config.residual_se.get(), config.covariance_factor.remainder.get());
        Self {
            config,
            common_variance: misfit * misfit + remainder * remainder,
            per_n_max: 1.0 / config.n_max.get(),
            per_p_max: 1.0 / config.p_max.get(),
            per_t_max: 1.0 / config.t_max.get(),
        }
    }

    /// Operating point in normalised variables x, y, z.
    #[inline(always)]
    #[must_use]
    pub fn normalised(&self, n_p: RevPerMin, p_h: Megapascal, t_b: Celsius) -> [f32; 3] {
        [n_p.get() * self.per_n_max, p_h.get() * self.per_p_max, t_b.get() * self.per_t_max]
    }

    /// Leakage coefficient at a normalised operating point. May be negative: a quadratic is not bounded.
    #[inline(always)]
    #[must_use]
    pub fn evaluate(&self, [x, y, z]: [f32; 3]) -> LeakageCoefficient {
        let k = &self.config;
        // Nested, for nine multiplications: c + x(b1 + a11 x + a12 y + a13 z) + y(b2 + a22 y + a23 z) + z(b3 + a33 z).
        LeakageCoefficient(
            k.c + x * (k.b1 + k.a11 * x + k.a12 * y + k.a13 * z)
                + y * (k.b2 + k.a22 * y + k.a23 * z)
                + z * (k.b3 + k.a33 * z),
        )
    }

    /// Derivatives of the coefficient per r/min, per MPa and per kelvin.
    #[inline(always)]
    #[must_use]
    pub(crate) fn gradient(&self, [n_p_rpm, p_h_mpa, t_b_c]: [f32; 3]) -> [f32; 3] {
        let k = &self.config;
        let [x, y, z] = [n_p_rpm * self.per_n_max, p_h_mpa * self.per_p_max, t_b_c * self.per_t_max];
        [
            (k.b1 + 2.0 * k.a11 * x + k.a12 * y + k.a13 * z) * self.per_n_max,
            (k.b2 + k.a12 * x + 2.0 * k.a22 * y + k.a23 * z) * self.per_p_max,
            (k.b3 + k.a13 * x + k.a23 * y + 2.0 * k.a33 * z) * self.per_t_max,
        ]
    }

    /// Standard error of the law at a normalised operating point: misfit and uncertainty of the coefficients.
    #[inline(always)]
    #[must_use]
    pub fn standard_error(&self, [x, y, z]: [f32; 3]) -> LeakageCoefficient {
        let phi = [1.0, x, y, z, x * x, y * y, z * z, x * y, x * z, y * z];
        LeakageCoefficient(square_root(self.common_variance + self.config.covariance_factor.variance(&phi)))
    }
}
