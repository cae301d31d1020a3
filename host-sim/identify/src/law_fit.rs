//! Fits the ten coefficients of the law to coefficients of operating points (paper eqs. 9-18).

use kou_estimator::model::calibrated_region::RegionConfig;
use kou_estimator::model::leakage_law::{LawConfig, LawCovarianceFactor};
use kou_estimator::units::{Celsius, LeakageCoefficient, Megapascal, RevPerMin};
use nalgebra::{DMatrix, DVector};

use super::least_squares::{self, Fit};

/// Names of the terms, in the order in which they are kept when the data cannot determine all of them: the constant,
/// then the linear terms, then squares, then products.
pub const TERMS: [&str; 10] = ["c", "b1", "b2", "b3", "a11", "a22", "a33", "a12", "a13", "a23"];

/// What must be left of a term's column, root mean square, in units of the normaliser's square at most. A bench holds
/// its set points to some 0.1 %, so a column that differs from the others by less differs by scatter only.
const MIN_RMS: f64 = 0.002;

/// Margin of the region around the points, in normalised variables: the scatter with which a set point is held.
const REGION_MARGIN: f32 = 0.01;

/// A fitted law.
#[derive(Debug, Clone, PartialEq)]
pub struct LawFit {
    /// Coefficients and normalisers for the estimator.
    pub law: LawConfig,
    /// Region around the points.
    pub region: RegionConfig,
    /// Names of the terms that the data do not determine.
    pub dropped: Vec<&'static str>,
    /// Condition number of the kept terms' columns.
    pub condition_number: f64,
}

impl LawFit {
    /// Fits the law to points `(n_p_rpm, p_h_mpa, t_b_c, kou)`; at least one.
    #[must_use]
    pub fn new(points: &[[f64; 4]]) -> Self {
        let largest = |of: fn(&[f64; 4]) -> f64| points.iter().map(of).fold(f64::MIN, f64::max);
        let n_max = largest(|[n, ..]| *n);
        let p_max = largest(|[_, p, ..]| *p);
        // A cold bench must not turn the sign of z around.
        let t_max = largest(|[_, _, t, _]| *t).max(10.0);
        let normalised = |[n, p, t, _]: &[f64; 4]| [n / n_max, p / p_max, t / t_max];
        let rows: Vec<[f64; 10]> = points.iter().map(|point| phi(normalised(point))).collect();
        let columns = DMatrix::from_row_iterator(rows.len(), 10, rows.into_iter().flatten());
        let observed = DVector::from_iterator(points.len(), points.iter().map(|[.., kou]| *kou));
        let Fit { coefficients, dropped, condition_number, residual_se, .. } =
            least_squares::fit(&columns, &observed, MIN_RMS);
        #[allow(clippy::cast_possible_truncation, reason = "the estimator works in f32")]
        let at = |i: usize| coefficients.get(i).copied().unwrap_or(0.0) as f32;
        #[allow(clippy::cast_possible_truncation, reason = "the estimator works in f32")]
        let single = |value: f64| value as f32;
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
}

/// The ten terms at normalised speed, pressure and temperature, in the order of [`TERMS`].
#[must_use]
pub fn phi([x, y, z]: [f64; 3]) -> [f64; 10] {
    [1.0, x, y, z, x * x, y * y, z * z, x * y, x * z, y * z]
}

/// Normalised speed, pressure and temperature of a point.
#[must_use]
pub fn normalised(law: &LawConfig, n_p_rpm: f64, p_h_mpa: f64, t_b_c: f64) -> [f64; 3] {
    let f = f64::from;
    [n_p_rpm / f(law.n_max.get()), p_h_mpa / f(law.p_max.get()), t_b_c / f(law.t_max.get())]
}

/// The coefficients in the order of [`TERMS`].
#[must_use]
pub fn coefficients(law: &LawConfig) -> [f64; 10] {
    [law.c, law.b1, law.b2, law.b3, law.a11, law.a22, law.a33, law.a12, law.a13, law.a23].map(f64::from)
}

/// Coefficients for physical variables (r/min, MPa, degC) in the order of [`TERMS`] (paper eqs. 16-18 undone).
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
    fn quadratic_truth_is_found_on_the_papers_grid() {
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
    fn terms_that_the_bench_cannot_determine_are_named_and_zero() {
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
