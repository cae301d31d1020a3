//! Rows of the points and what is known beforehand as one least-squares problem, and its solution.

use nalgebra::{DMatrix, DVector};

use super::linear::Linear;
use super::search::Fitted;

/// A stacked problem: weighted rows of the points, then one row for each unknown that is known beforehand. Columns are of
/// one length, since their units are no reason for a bad condition.
pub(super) struct Stacked {
    whole: DMatrix<f64>,
    right: DVector<f64>,
    scale: Vec<f64>,
}

/// One step to the solution, and what the points say about it.
pub(super) struct Step {
    pub(super) delta: DVector<f64>,
    pub(super) covariance_root: DMatrix<f64>,
    /// Of every stacked row.
    pub(super) leverage: Vec<f64>,
    /// How far the unknowns are from a fit without the stacked row, a row for each.
    pub(super) shift_without: DMatrix<f64>,
    pub(super) condition_number: f64,
}

impl Stacked {
    /// The rows of `linear` with the weights of a fit, and where its unknowns are from what is known beforehand.
    pub(super) fn new(linear: &Linear, fitted: &Fitted, prior_se: &[f64]) -> Self {
        let (n, count) = linear.jacobian.shape();
        let known: Vec<usize> = (0..count).filter(|j| prior_se[*j].is_finite()).collect();
        let mut whole = DMatrix::zeros(n + known.len(), count);
        let mut right = DVector::zeros(n + known.len());
        for i in 0..n {
            let root = fitted.weight[i].sqrt();
            for j in 0..count {
                whole[(i, j)] = root * linear.jacobian[(i, j)];
            }
            right[i] = root * linear.residual[i];
        }
        for (k, j) in known.iter().enumerate() {
            whole[(n + k, *j)] = 1.0 / prior_se[*j];
            right[n + k] = -fitted.unknowns[*j] / prior_se[*j];
        }
        let scale: Vec<f64> = whole.column_iter().map(|c| c.norm().max(f64::MIN_POSITIVE)).collect();
        for (j, s) in scale.iter().enumerate() {
            whole.column_mut(j).unscale_mut(*s);
        }
        Self { whole, right, scale }
    }

    /// One Gauss-Newton step.
    pub(super) fn solve(self) -> Step {
        let Self { whole, right, scale } = self;
        let svd = whole.svd(true, true);
        let (Some(u), Some(v_t)) = (&svd.u, &svd.v_t) else { unreachable!("both were asked for") };
        let largest = svd.singular_values.max();
        let inverse: Vec<f64> =
            svd.singular_values.iter().map(|s| if *s > 1e-12 * largest { 1.0 / s } else { 0.0 }).collect();
        let mut root = v_t.transpose();
        for (k, inverse) in inverse.iter().enumerate() {
            root.column_mut(k).scale_mut(*inverse);
        }
        for (j, s) in scale.iter().enumerate() {
            root.row_mut(j).unscale_mut(*s);
        }
        let delta = &root * (u.transpose() * &right);
        let leverage: Vec<f64> = (0..u.nrows()).map(|i| u.row(i).norm_squared().min(1.0)).collect();
        let mut shift_without = u * root.transpose();
        for (i, h) in leverage.iter().enumerate() {
            shift_without.row_mut(i).scale_mut(right[i] / (1.0 - h).max(1e-3));
        }
        Step {
            delta,
            covariance_root: root,
            leverage,
            shift_without,
            condition_number: largest / svd.singular_values.min().max(f64::MIN_POSITIVE),
        }
    }

    /// Twice the negative logarithm of the problem's marginal likelihood, but for a constant and the rows' own errors: the
    /// logarithm of the determinant of its normal matrix, and the squares that no choice of the unknowns removes.
    pub(super) fn unlikelihood(self) -> f64 {
        let (rows, columns) = self.whole.shape();
        if rows < columns {
            return f64::INFINITY;
        }
        let qr = self.whole.qr();
        let mut right = self.right;
        qr.q_tr_mul(&mut right);
        let determinant: f64 =
            qr.r().diagonal().iter().zip(&self.scale).map(|(r, s)| (r.abs() * s).ln()).sum();
        2.0 * determinant + right.rows(columns, rows - columns).norm_squared()
    }
}
