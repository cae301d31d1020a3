//! Least-squares problem of one Gauss-Newton step: weighted rows of the points, augmented by one row for each prior.

use nalgebra::{DMatrix, DVector};

/// Augmented least-squares problem with columns scaled to unit norm (van der Sluis 1969).
#[derive(Debug, Clone)]
pub struct LeastSquares {
    lhs: DMatrix<f64>,
    rhs: DVector<f64>,
    scale: Vec<f64>,
}

/// Gauss-Newton step with its statistics.
#[derive(Debug, Clone)]
pub struct GaussNewtonStep {
    /// Change of the unknowns.
    pub delta: DVector<f64>,
    /// Factor `L` of the covariance `L L^T`.
    pub covariance_factor: DMatrix<f64>,
    /// Leverage of every row, diagonal of the hat matrix.
    pub leverage: Vec<f64>,
    /// Leave-one-out shift of the unknowns, one row for each row of the problem (DFBETA: Belsley, Kuh and Welsch 1980).
    pub leave_one_out_shift: DMatrix<f64>,
    /// Condition number of the scaled matrix.
    pub condition_number: f64,
}

impl LeastSquares {
    /// Problem of a whitened Jacobian and residual with row weights, at `unknowns` with zero prior means and prior standard
    /// errors `prior_se`; infinite without prior.
    #[must_use]
    pub fn new(
        jacobian: &DMatrix<f64>,
        residual: &DVector<f64>,
        weight: &[f64],
        unknowns: &[f64],
        prior_se: &[f64],
    ) -> Self {
        let (n, count) = jacobian.shape();
        let with_prior: Vec<usize> = (0..count).filter(|j| prior_se[*j].is_finite()).collect();
        let mut lhs = DMatrix::zeros(n + with_prior.len(), count);
        let mut rhs = DVector::zeros(n + with_prior.len());
        for i in 0..n {
            let root = weight[i].sqrt();
            for j in 0..count {
                lhs[(i, j)] = root * jacobian[(i, j)];
            }
            rhs[i] = root * residual[i];
        }
        for (k, j) in with_prior.iter().enumerate() {
            lhs[(n + k, *j)] = 1.0 / prior_se[*j];
            rhs[n + k] = -unknowns[*j] / prior_se[*j];
        }
        let scale: Vec<f64> = lhs.column_iter().map(|c| c.norm().max(f64::MIN_POSITIVE)).collect();
        for (j, s) in scale.iter().enumerate() {
            lhs.column_mut(j).unscale_mut(*s);
        }
        Self { lhs, rhs, scale }
    }

    /// Gauss-Newton step by singular value decomposition (Golub and Van Loan 2013, section 5.5).
    #[must_use]
    pub fn solve(self) -> GaussNewtonStep {
        let Self { lhs, rhs, scale } = self;
        let svd = lhs.svd(true, true);
        let (Some(u), Some(v_t)) = (&svd.u, &svd.v_t) else { unreachable!("both factors were requested") };
        let largest = svd.singular_values.max();
        let inverse: Vec<f64> =
            svd.singular_values.iter().map(|s| if *s > 1e-12 * largest { 1.0 / s } else { 0.0 }).collect();
        let mut factor = v_t.transpose();
        for (k, inverse) in inverse.iter().enumerate() {
            factor.column_mut(k).scale_mut(*inverse);
        }
        for (j, s) in scale.iter().enumerate() {
            factor.row_mut(j).unscale_mut(*s);
        }
        let delta = &factor * (u.transpose() * &rhs);
        let leverage: Vec<f64> = (0..u.nrows()).map(|i| u.row(i).norm_squared().min(1.0)).collect();
        let mut leave_one_out_shift = u * factor.transpose();
        for (i, h) in leverage.iter().enumerate() {
            leave_one_out_shift.row_mut(i).scale_mut(rhs[i] / (1.0 - h).max(1e-3));
        }
        GaussNewtonStep {
            delta,
            covariance_factor: factor,
            leverage,
            leave_one_out_shift,
            condition_number: largest / svd.singular_values.min().max(f64::MIN_POSITIVE),
        }
    }

    /// -2 log restricted likelihood, up to a constant and the rows' own variances (Patterson and Thompson 1971): `ln det` of the
    /// normal matrix plus the residual sum of squares, both from a QR decomposition.
    #[doc(alias = "restricted likelihood")]
    #[doc(alias = "REML")]
    #[doc(alias = "marginal likelihood")]
    #[must_use]
    pub fn neg2_log_reml(self) -> f64 {
        let (rows, columns) = self.lhs.shape();
        if rows < columns {
            return f64::INFINITY;
        }
        let qr = self.lhs.qr();
        let mut rhs = self.rhs;
        qr.q_tr_mul(&mut rhs);
        let determinant: f64 =
            qr.r().diagonal().iter().zip(&self.scale).map(|(r, s)| (r.abs() * s).ln()).sum();
        2.0 * determinant + rhs.rows(columns, rows - columns).norm_squared()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean of three observations of unit variance, without prior.
    fn mean_of(observed: [f64; 3]) -> LeastSquares {
        let jacobian = DMatrix::from_element(3, 1, 1.0);
        LeastSquares::new(&jacobian, &DVector::from_row_slice(&observed), &[1.0; 3], &[0.0], &[f64::INFINITY])
    }

    #[test]
    fn step_to_the_mean_has_its_variance_and_leverage() {
        let step = mean_of([1.0, 2.0, 6.0]).solve();
        assert!((step.delta[0] - 3.0).abs() < 1e-12);
        assert!((step.covariance_factor.norm_squared() - 1.0 / 3.0).abs() < 1e-12);
        assert!(step.leverage.iter().all(|h| (h - 1.0 / 3.0).abs() < 1e-12));
    }

    #[test]
    fn restricted_likelihood_of_a_mean_is_the_textbook_formula() {
        // ln n + sum (y - mean)^2.
        let exact = 3.0_f64.ln() + 4.0 + 1.0 + 9.0;
        assert!((mean_of([1.0, 2.0, 6.0]).neg2_log_reml() - exact).abs() < 1e-12);
    }

    #[test]
    fn prior_pulls_the_solution_to_zero() {
        let jacobian = DMatrix::from_element(1, 1, 1.0);
        let problem = LeastSquares::new(&jacobian, &DVector::from_row_slice(&[2.0]), &[1.0], &[0.0], &[1.0]);
        assert!((problem.solve().delta[0] - 1.0).abs() < 1e-12);
    }
}
