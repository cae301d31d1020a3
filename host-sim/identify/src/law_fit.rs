//! Least-squares fit of the leakage law, a quadratic in three variables, to leakage coefficients (Wang et al., eqs. 9-18).

use kou_estimator::model::calibrated_region::RegionConfig;
use kou_estimator::model::leakage_law::{LawConfig, LawCovarianceFactor};
use kou_estimator::units::{Celsius, LeakageCoefficient, Megapascal, RevPerMin};
use kou_records::BenchPoint;
use nalgebra::{DMatrix, DVector};

use crate::convert::single;
use crate::rank_revealing::{self, RankRevealingFit};

/// Names of the terms, in the order of priority when the points do not determine all of them: constant, linear terms,
/// squares, products.
pub const TERMS: [&str; 10] = ["c", "b1", "b2", "b3", "a11", "a22", "a33", "a12", "a13", "a23"];

/// Minimum root mean square of a term's column after projection onto the complement of the earlier columns, in normalised
/// units. Set points scatter by some 0.1 %; a smaller remainder is that scatter.
const MIN_RMS: f64 = 0.002;

/// Margin of the region around the points, in normalised variables: the scatter of the set points.
const REGION_MARGIN: f32 = 0.01;

/// Fitted leakage law.
#[derive(Debug, Clone, PartialEq)]
pub struct LawFit {
    /// Coefficients and normalisers for the estimator.
    pub law: LawConfig,
    /// Calibrated region around the points.
    pub region: RegionConfig,
    /// Names of the terms that the points do not determine; their coefficients are zero.
    pub dropped: Vec<&'static str>,
    /// Condition number of the columns of the remaining terms.
    pub condition_number: f64,
}

impl LawFit {
    /// Fits the law to points `(n_p_rpm, p_h_mpa, t_b_c, kou)`; at least one.
    #[must_use]
    pub fn new(points: &[[f64; 4]]) -> Self {
        let largest = |of: fn(&[f64; 4]) -> f64| points.iter().map(of).fold(f64::MIN, f64::max);
        let n_max = largest(|[n, ..]| *n);
        let p_max = largest(|[_, p, ..]| *p);
        // A positive normaliser also for a cold bench: the sign of z must not change.
        let t_max = largest(|[_, _, t, _]| *t).max(10.0);
        let normalised = |[n, p, t, _]: &[f64; 4]| [n / n_max, p / p_max, t / t_max];
        let rows: Vec<[f64; 10]> = points.iter().map(|point| phi(normalised(point))).collect();
        let columns = DMatrix::from_row_iterator(rows.len(), 10, rows.into_iter().flatten());
        let observed = DVector::from_iterator(points.len(), points.iter().map(|[.., kou]| *kou));
        let RankRevealingFit { coefficients, dropped, condition_number, residual_se, .. } =
            rank_revealing::fit(&columns, &observed, MIN_RMS);
        let at = |i: usize| single(coefficients.get(i).copied().unwrap_or(0.0));
        Self {
            law: LawConfig {
                c: at(0),
                b1: at(1),
                b2: at(2),
                b3: at(3),
                a11: at(4),
                a22: at(5),
                a33: at(6),
                a12: at(7),
                a13: at(8),
                a23: at(9),
                n_max: RevPerMin(single(n_max)),
                p_max: Megapascal(single(p_max)),
                t_max: Celsius(single(t_max)),
                residual_se: LeakageCoefficient(single(residual_se)),
                covariance_factor: LawCovarianceFactor::ZERO,
            },
            region: RegionConfig::around(points.iter().map(|p| normalised(p).map(single)), REGION_MARGIN),
            dropped: dropped.into_iter().filter_map(|i| TERMS.get(i).copied()).collect(),
            condition_number,
        }
    }

    /// Indices into [`TERMS`] of the terms that the points determine.
    #[must_use]
    pub fn determined_terms(&self) -> Vec<usize> {
        (0..TERMS.len()).filter(|i| TERMS.get(*i).is_some_and(|t| !self.dropped.contains(t))).collect()
    }

    /// Leakage coefficient by the law at a bench point, in f64.
    #[must_use]
    pub fn kou(&self, point: &BenchPoint) -> f64 {
        let x = normalised(&self.law, point.n_p_rpm, point.p_h_mpa, point.t_b_c);
        coefficients(&self.law).iter().zip(phi(x)).map(|(k, f)| k * f).sum()
    }
}

/// Regressor of the law: the ten terms at normalised speed, pressure and temperature, in the order of [`TERMS`].
#[must_use]
pub fn phi([x, y, z]: [f64; 3]) -> [f64; 10] {
    [1.0, x, y, z, x * x, y * y, z * z, x * y, x * z, y * z]
}

/// Normalised speed, pressure and temperature.
#[must_use]
pub fn normalised(law: &LawConfig, n_p_rpm: f64, p_h_mpa: f64, t_b_c: f64) -> [f64; 3] {
    let f = f64::from;
    [n_p_rpm / f(law.n_max.get()), p_h_mpa / f(law.p_max.get()), t_b_c / f(law.t_max.get())]
}

/// Coefficients for normalised variables, in the order of [`TERMS`].
#[must_use]
pub fn coefficients(law: &LawConfig) -> [f64; 10] {
    [law.c, law.b1, law.b2, law.b3, law.a11, law.a22, law.a33, law.a12, law.a13, law.a23].map(f64::from)
}

/// Coefficients for physical variables (r/min, MPa, degC), in the order of [`TERMS`] (inverse of Wang et al., eqs. 16-18).
#[must_use]
pub fn physical(law: &LawConfig) -> [f64; 10] {
    let f = f64::from;
    let (n, p, t) = (f(law.n_max.get()), f(law.p_max.get()), f(law.t_max.get()));
    [
        f(law.c),
        f(law.b1) / n,
        f(law.b2) / p,
        f(law.b3) / t,
        f(law.a11) / (n * n),
        f(law.a22) / (p * p),
        f(law.a33) / (t * t),
        f(law.a12) / (n * p),
        f(law.a13) / (n * t),
        f(law.a23) / (p * t),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn truth(n: f64, p: f64, t: f64) -> f64 {
        let (x, y, z) = (n / 2800.0, p / 50.0, t / 90.0);
        0.03 * x * x + 0.01 * y * y + 0.02 * z * z - 0.005 * x * y + 0.02 * x * z - 0.01 * y * z + 0.02 * x
            - 0.01 * y
            + 0.005 * z
            + 0.02
    }

    fn grid(ns: &[f64], ps: &[f64], ts: &[f64]) -> Vec<[f64; 4]> {
        let mut points = Vec::new();
        for &n in ns {
            for &p in ps {
                for &t in ts {
                    points.push([n, p, t, truth(n, p, t)]);
                }
            }
        }
        points
    }

    #[test]
    fn quadratic_law_is_recovered_on_the_papers_grid() {
        let points = grid(&[1000.0, 2000.0, 2800.0], &[10.0, 20.0, 30.0, 40.0, 50.0], &[30.0, 60.0, 90.0]);
        let fit = LawFit::new(&points);
        assert!(fit.dropped.is_empty());
        for (got, wanted) in
            [(fit.law.a11, 0.03), (fit.law.a13, 0.02), (fit.law.c, 0.02), (fit.law.b2, -0.01)]
        {
            // Exact but for rounding to f32.
            assert!((got - wanted).abs() < 1e-7, "{got} {wanted}");
        }
    }

    #[test]
    fn undetermined_terms_are_named_and_zero() {
        let one_temperature = LawFit::new(&grid(&[1000.0, 2000.0, 2800.0], &[10.0, 30.0, 50.0], &[60.0]));
        assert_eq!(one_temperature.dropped, ["b3", "a33", "a13", "a23"]);
        // Two temperatures, held with 0.1 % scatter, do not determine a curvature.
        let mut scattered = grid(&[1000.0, 2000.0, 2800.0], &[10.0, 30.0, 50.0], &[60.0, 90.0]);
        for (i, point) in scattered.iter_mut().enumerate() {
            point[2] *= 1.0 + 1e-3 * ((i * 7 % 5) as f64 / 2.5 - 0.8);
        }
        let two_temperatures = LawFit::new(&scattered);
        assert_eq!(two_temperatures.dropped, ["a33"]);
        assert!(two_temperatures.law.b3.abs() < 0.2, "{:?}", two_temperatures.law);
        let one_point = LawFit::new(&grid(&[1000.0], &[30.0], &[60.0]));
        assert_eq!(one_point.dropped.len(), 9);
    }

    #[test]
    fn physical_coefficients_give_the_same_law() {
        let fit = LawFit::new(&grid(&[1000.0, 2000.0, 2800.0], &[10.0, 30.0, 50.0], &[30.0, 60.0, 90.0]));
        let k = physical(&fit.law);
        let (n, p, t) = (1234.0, 22.0, 71.0);
        let by_physical: f64 =
            k.iter().zip([1.0, n, p, t, n * n, p * p, t * t, n * p, n * t, p * t]).map(|(k, v)| k * v).sum();
        assert!((by_physical - truth(n, p, t)).abs() < 1e-6);
    }
}
