//! What a quadratic law misses of a real machine's leakage, as an unknown smooth function beside the law.
//!
//! A Gaussian process in relative leakage (Kennedy and O'Hagan 2001): variance `size^2`, correlation
//! `exp(-|x - x'|^2/(2 length^2))` over normalised speed, pressure and temperature. It is written as a sum of few functions with
//! coefficients of unit prior variance, by a Cholesky decomposition of the points' correlation that takes the worst
//! represented point first and stops when little is left; what is left is the point's own. Every function has its best
//! quadratic taken off, so the law's coefficients are those of the best quadratic and the functions hold only what that
//! misses. `docs/identification.md` derives it and shows what it is worth.

use nalgebra::{DMatrix, DVector};

/// Share of the variance that may stay unrepresented at any point.
const LEFT: f64 = 0.01;
/// Most functions; a bench of thousands of points over the usual envelope needs about thirty at the shortest length.
const MOST: usize = 40;
/// Leakage is relative to no less than this share of its mean, so that a law near zero somewhere gives no point infinite
/// weight.
const LEAST_SHARE: f64 = 0.1;

/// Size and length of the function, both found from the points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shape {
    /// Standard deviation, relative to the leakage.
    pub size: f64,
    /// Length of correlation in normalised variables.
    pub length: f64,
}

impl Shape {
    /// Shapes to choose from. Shorter lengths than the bench's spacing are noise, longer ones a quadratic.
    pub fn all() -> impl Iterator<Item = Self> {
        let sizes = [0.005, 0.01, 0.02, 0.04, 0.08, 0.16];
        [0.25, 0.35, 0.5, 0.7].into_iter().flat_map(move |length| sizes.map(|size| Self { size, length }))
    }
}

/// The functions for one length.
#[derive(Debug, Clone, PartialEq)]
pub struct Basis {
    length: f64,
    centres: Vec<[f64; 3]>,
    /// Rows of the lower triangular factor at the centres.
    factor: Vec<Vec<f64>>,
}

impl Basis {
    /// Functions that represent the process at these points.
    #[must_use]
    pub fn over(points: &[[f64; 3]], length: f64) -> Self {
        let mut basis = Self { length, centres: Vec::new(), factor: Vec::new() };
        let mut values: Vec<Vec<f64>> = vec![Vec::new(); points.len()];
        let mut left: Vec<f64> = vec![1.0; points.len()];
        while basis.centres.len() < MOST {
            let worst = left.iter().copied().enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
            let Some((pivot, _)) = worst.filter(|(_, variance)| *variance > LEFT) else { break };
            let mut row = values[pivot].clone();
            row.push(left[pivot].sqrt());
            basis.centres.push(points[pivot]);
            basis.factor.push(row);
            for ((point, values), left) in points.iter().zip(&mut values).zip(&mut left) {
                let next = basis.next(point, values);
                *left = (*left - next * next).max(0.0);
                values.push(next);
            }
        }
        basis
    }

    /// Value of the function behind those whose values are given.
    fn next(&self, point: &[f64; 3], values: &[f64]) -> f64 {
        let k = values.len();
        let (centre, row) = (&self.centres[k], &self.factor[k]);
        let distance2: f64 = point.iter().zip(centre).map(|(a, b)| (a - b).powi(2)).sum();
        let known: f64 = values.iter().zip(row).map(|(a, b)| a * b).sum();
        ((-0.5 * distance2 / self.length.powi(2)).exp() - known) / row[k]
    }

    /// Values of all functions at a point, for a process of unit variance.
    #[must_use]
    pub fn at(&self, point: &[f64; 3]) -> Vec<f64> {
        let mut values = Vec::with_capacity(self.centres.len());
        while values.len() < self.centres.len() {
            values.push(self.next(point, &values));
        }
        values
    }

    /// Number of functions.
    #[must_use]
    pub fn count(&self) -> usize {
        self.centres.len()
    }
}

/// The functions in units of Kou, without their quadratics.
#[derive(Debug, Clone)]
pub struct Discrepancy {
    basis: Basis,
    size: f64,
    least_kou: f64,
    /// Coefficients of the quadratic that is taken off, a column for each function.
    law_part: DMatrix<f64>,
    /// Leverage of each point on that quadratic.
    leverage: Vec<f64>,
}

/// The functions at one point.
#[derive(Debug, Clone)]
pub struct AtPoint {
    /// Values in units of Kou, one for each function.
    pub kou: Vec<f64>,
    /// Standard deviation of what they do not represent, in units of Kou.
    pub left: f64,
}

impl Discrepancy {
    /// Takes from every function the quadratic that is nearest to it over the points, errors relative to their leakage.
    #[must_use]
    pub fn new(basis: Basis, size: f64, points: &[[f64; 3]], terms: &[&[f64]], kou: &[f64]) -> Self {
        let (n, kept) = (points.len(), terms.first().map_or(0, |t| t.len()));
        let least_kou = LEAST_SHARE * kou.iter().map(|k| k.abs()).sum::<f64>() / n.max(1) as f64;
        let weight = |i: usize| 1.0 / kou[i].max(least_kou).max(f64::MIN_POSITIVE);
        let law = DMatrix::from_fn(n, kept, |i, j| weight(i) * terms[i][j]);
        let functions = {
            let all: Vec<f64> = points.iter().flat_map(|x| basis.at(x)).map(|f| size * f).collect();
            DMatrix::from_row_slice(n, basis.count(), &all)
        };
        let scale: Vec<f64> = law.column_iter().map(|c| c.norm().max(f64::MIN_POSITIVE)).collect();
        let scaled = DMatrix::from_fn(n, kept, |i, j| law[(i, j)] / scale[j]);
        // No rows or no columns: nothing is taken off.
        let mut law_part = DMatrix::zeros(kept, basis.count());
        let mut leverage = vec![0.0; n];
        if n > 0 && kept > 0 && basis.count() > 0 {
            let svd = scaled.svd(true, true);
            let cut = 1e-10 * svd.singular_values.max();
            if let Some(u) = &svd.u {
                leverage = u.row_iter().map(|row| row.norm_squared()).collect();
            }
            if let Ok(solution) = svd.solve(&functions, cut) {
                law_part = DMatrix::from_fn(kept, basis.count(), |i, j| solution[(i, j)] / scale[i]);
            }
        }
        Self { basis, size, least_kou, law_part, leverage }
    }

    /// The functions at a point with its row of the law's terms and its leakage.
    #[must_use]
    pub fn at(&self, point: &[f64; 3], terms: &[f64], kou: f64) -> AtPoint {
        let relative = self.basis.at(point);
        let left2 = 1.0 - relative.iter().map(|f| f * f).sum::<f64>();
        let kou = kou.max(self.least_kou);
        let quadratic = self.law_part.transpose() * DVector::from_row_slice(terms);
        AtPoint {
            kou: relative.iter().zip(&quadratic).map(|(f, q)| self.size * kou * f - q).collect(),
            left: self.size * kou * left2.max(0.0).sqrt(),
        }
    }

    /// How much lower the quadratic would be at one of the points it was taken off at, without that point, per unit of what
    /// the functions add to the law there.
    #[must_use]
    pub fn pull(&self, point: usize) -> f64 {
        let h = self.leverage.get(point).copied().unwrap_or(0.0);
        h / (1.0 - h).max(1e-3)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> Vec<[f64; 3]> {
        let mut all = Vec::new();
        for x in [0.36, 0.71, 1.0] {
            for y in [0.2, 0.4, 0.6, 0.8, 1.0] {
                all.extend([0.33, 0.67, 1.0].map(|z| [x, y, z]));
            }
        }
        all
    }

    #[test]
    fn prop_functions_have_the_processes_correlation() {
        let points = grid();
        let basis = Basis::over(&points, 0.35);
        assert!(basis.count() < points.len(), "{}", basis.count());
        for a in &points {
            for b in &points {
                let distance2: f64 = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum();
                let wanted = (-0.5 * distance2 / 0.35f64.powi(2)).exp();
                let had: f64 = basis.at(a).iter().zip(basis.at(b)).map(|(f, g)| f * g).sum();
                // What is left of a variance bounds what is left of a covariance.
                assert!((had - wanted).abs() <= LEFT + 1e-9, "{a:?} {b:?}: {had} {wanted}");
            }
        }
    }

    #[test]
    fn prop_no_quadratic_is_left_in_the_functions() {
        let points = grid();
        let terms: Vec<[f64; 10]> = points.iter().map(|x| super::super::law_fit::phi(*x)).collect();
        let rows: Vec<&[f64]> = terms.iter().map(<[f64; 10]>::as_slice).collect();
        let kou: Vec<f64> = points.iter().map(|[x, y, z]| 0.02 + 0.03 * x + 0.02 * y * z).collect();
        let of = Discrepancy::new(Basis::over(&points, 0.35), 0.02, &points, &rows, &kou);
        for k in 0..of.basis.count() {
            let mut dots = [0.0; 10];
            for ((point, terms), kou) in points.iter().zip(&terms).zip(&kou) {
                let function = of.at(point, terms, *kou).kou[k];
                for (dot, term) in dots.iter_mut().zip(terms) {
                    *dot += function * term / kou.powi(2);
                }
            }
            // Each factor is of order one or below, times 45 points and 1/Kou up to 40: rounding only.
            assert!(dots.iter().all(|dot| dot.abs() < 1e-9), "function {k}: {dots:?}");
        }
    }
}
