//! Model discrepancy: the part of the leakage that a quadratic law cannot represent, as a Gaussian process.
//!
//! Zero-mean Gaussian process in relative leakage (Kennedy and O'Hagan 2001) with the squared-exponential
//! covariance `sigma^2 exp(-|x - x'|^2/(2 length_scale^2))` over normalised speed, pressure and temperature (Rasmussen and
//! Williams 2006, eq. 4.9). A pivoted, incomplete Cholesky decomposition of the correlation matrix of the points (Harbrecht,
//! Peters and Schneider 2012) gives a low-rank basis whose coefficients have unit prior variance; the truncated remainder is
//! independent noise of each point. Every basis function is orthogonalised against the quadratic terms, so that the law's
//! coefficients are those of the best quadratic. Derivation and effect: `docs/identification.md`.

use nalgebra::{DMatrix, DVector};

/// Tolerance of the decomposition: maximum share of the variance that remains unrepresented at any point.
const RESIDUAL_TOL: f64 = 0.01;
/// Maximum number of basis functions; thousands of points over the default envelope need about thirty at the shortest length
/// scale.
const MAX_BASIS: usize = 40;
/// Lower bound of the leakage to which errors are relative, as a share of the mean leakage: limits the weight of points where
/// the law is near zero.
const MIN_SHARE: f64 = 0.1;

/// Hyperparameters of the squared-exponential kernel, both selected from the points.
#[derive(Debug, Clone, Copy, PartialEq)]
#[doc(alias = "hyperparameters")]
#[doc(alias = "Gaussian process")]
pub struct Kernel {
    /// Standard deviation, relative to the leakage.
    pub sigma: f64,
    /// Length scale in normalised variables.
    pub length_scale: f64,
}

impl Kernel {
    /// No discrepancy.
    pub const NONE: Self = Self { sigma: 0.0, length_scale: 1.0 };

    /// Grid of candidates. A length scale below the spacing of the bench points is noise, a longer one than these a quadratic.
    pub fn candidates() -> impl Iterator<Item = Self> {
        let sigmas = [0.005, 0.01, 0.02, 0.04, 0.08, 0.16];
        [0.25, 0.35, 0.5, 0.7]
            .into_iter()
            .flat_map(move |length_scale| sigmas.map(|sigma| Self { sigma, length_scale }))
    }
}

/// Basis functions of the process with one length scale and unit variance.
#[derive(Debug, Clone, PartialEq)]
pub struct Basis {
    length_scale: f64,
    centres: Vec<[f64; 3]>,
    /// Rows of the Cholesky factor at the centres.
    factor: Vec<Vec<f64>>,
}

impl Basis {
    /// Basis that represents the process at these points, by a Cholesky decomposition with diagonal pivoting.
    #[must_use]
    #[doc(alias = "pivoted Cholesky")]
    pub fn over(points: &[[f64; 3]], length_scale: f64) -> Self {
        let mut basis = Self { length_scale, centres: Vec::new(), factor: Vec::new() };
        let mut values: Vec<Vec<f64>> = vec![Vec::new(); points.len()];
        let mut variances: Vec<f64> = vec![1.0; points.len()];
        while basis.centres.len() < MAX_BASIS {
            let worst = variances.iter().copied().enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
            let Some((pivot, _)) = worst.filter(|(_, variance)| *variance > RESIDUAL_TOL) else { break };
            let mut row = values[pivot].clone();
            row.push(variances[pivot].sqrt());
            basis.centres.push(points[pivot]);
            basis.factor.push(row);
            for ((point, values), variance) in points.iter().zip(&mut values).zip(&mut variances) {
                let next = basis.next(point, values);
                *variance = (*variance - next * next).max(0.0);
                values.push(next);
            }
        }
        basis
    }

    /// Value of the basis function that follows those whose values are given.
    fn next(&self, point: &[f64; 3], values: &[f64]) -> f64 {
        let k = values.len();
        let (centre, row) = (&self.centres[k], &self.factor[k]);
        let distance2: f64 = point.iter().zip(centre).map(|(a, b)| (a - b).powi(2)).sum();
        let known: f64 = values.iter().zip(row).map(|(a, b)| a * b).sum();
        ((-0.5 * distance2 / self.length_scale.powi(2)).exp() - known) / row[k]
    }

    /// Values of all basis functions at a point.
    #[must_use]
    pub fn at(&self, point: &[f64; 3]) -> Vec<f64> {
        let mut values = Vec::with_capacity(self.centres.len());
        while values.len() < self.centres.len() {
            values.push(self.next(point, &values));
        }
        values
    }

    /// Number of basis functions.
    #[must_use]
    pub fn count(&self) -> usize {
        self.centres.len()
    }
}

/// Discrepancy of the law: basis functions in units of Kou, orthogonal to the quadratic terms.
#[derive(Debug, Clone)]
pub struct Discrepancy {
    basis: Basis,
    sigma: f64,
    min_kou: f64,
    /// Coefficients of the subtracted quadratic, one column for each basis function.
    projection: DMatrix<f64>,
    /// Leverage of each point on that quadratic.
    leverage: Vec<f64>,
}

/// Discrepancy at one point.
#[derive(Debug, Clone)]
pub struct DiscrepancyAtPoint {
    /// Values of the basis functions in units of Kou.
    pub kou: Vec<f64>,
    /// Standard deviation of the truncated remainder, in units of Kou.
    pub remainder: f64,
}

impl Discrepancy {
    /// Subtracts from every basis function its weighted least-squares quadratic over the points; errors are relative to the
    /// leakage `kou` of each point, `terms` are the regressors of the law.
    #[must_use]
    pub fn new(basis: Basis, sigma: f64, points: &[[f64; 3]], terms: &[&[f64]], kou: &[f64]) -> Self {
        let (n, count) = (points.len(), terms.first().map_or(0, |t| t.len()));
        let min_kou = MIN_SHARE * kou.iter().map(|k| k.abs()).sum::<f64>() / n.max(1) as f64;
        let weight = |i: usize| 1.0 / kou[i].max(min_kou).max(f64::MIN_POSITIVE);
        let law = DMatrix::from_fn(n, count, |i, j| weight(i) * terms[i][j]);
        let functions = {
            let all: Vec<f64> = points.iter().flat_map(|x| basis.at(x)).map(|f| sigma * f).collect();
            DMatrix::from_row_slice(n, basis.count(), &all)
        };
        let scale: Vec<f64> = law.column_iter().map(|c| c.norm().max(f64::MIN_POSITIVE)).collect();
        let scaled = DMatrix::from_fn(n, count, |i, j| law[(i, j)] / scale[j]);
        // Without rows or columns nothing is subtracted.
        let mut projection = DMatrix::zeros(count, basis.count());
        let mut leverage = vec![0.0; n];
        if n > 0 && count > 0 && basis.count() > 0 {
            let svd = scaled.svd(true, true);
            let cut = 1e-10 * svd.singular_values.max();
            if let Some(u) = &svd.u {
                leverage = u.row_iter().map(|row| row.norm_squared()).collect();
            }
            if let Ok(solution) = svd.solve(&functions, cut) {
                projection = DMatrix::from_fn(count, basis.count(), |i, j| solution[(i, j)] / scale[i]);
            }
        }
        Self { basis, sigma, min_kou, projection, leverage }
    }

    /// Discrepancy at a point with the law's regressor `terms` and leakage coefficient `kou`.
    #[must_use]
    pub fn at(&self, point: &[f64; 3], terms: &[f64], kou: f64) -> DiscrepancyAtPoint {
        let relative = self.basis.at(point);
        let remainder2 = 1.0 - relative.iter().map(|f| f * f).sum::<f64>();
        let kou = kou.max(self.min_kou);
        let quadratic = self.projection.transpose() * DVector::from_row_slice(terms);
        DiscrepancyAtPoint {
            kou: relative.iter().zip(&quadratic).map(|(f, q)| self.sigma * kou * f - q).collect(),
            remainder: self.sigma * kou * remainder2.max(0.0).sqrt(),
        }
    }

    /// Leave-one-out shift of the subtracted quadratic at one of its points, per unit of discrepancy there: `h/(1 - h)` with
    /// the point's leverage `h`.
    #[must_use]
    pub fn leave_one_out_gain(&self, point: usize) -> f64 {
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
    fn prop_basis_reproduces_the_correlation_of_the_process() {
        let points = grid();
        let basis = Basis::over(&points, 0.35);
        assert!(basis.count() < points.len(), "{}", basis.count());
        for a in &points {
            for b in &points {
                let distance2: f64 = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum();
                let exact = (-0.5 * distance2 / 0.35f64.powi(2)).exp();
                let represented: f64 = basis.at(a).iter().zip(basis.at(b)).map(|(f, g)| f * g).sum();
                // The remaining variances bound the remaining covariance (Cauchy-Schwarz).
                assert!(
                    (represented - exact).abs() <= RESIDUAL_TOL + 1e-9,
                    "{a:?} {b:?}: {represented} {exact}"
                );
            }
        }
    }

    #[test]
    fn prop_basis_is_orthogonal_to_the_quadratic_terms() {
        let points = grid();
        let terms: Vec<[f64; 10]> = points.iter().map(|x| crate::law_fit::phi(*x)).collect();
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
            // Bound: rounding of factors of order one, times 45 points and 1/Kou up to 40.
            assert!(dots.iter().all(|dot| dot.abs() < 1e-9), "function {k}: {dots:?}");
        }
    }
}
