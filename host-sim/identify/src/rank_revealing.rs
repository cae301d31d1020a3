//! Rank-revealing linear least squares by Gram-Schmidt orthogonalisation.
//!
//! Columns are processed in the given order, so the caller orders them by priority. A column whose component orthogonal to
//! the earlier ones is too small is not determined by the data: it is dropped and its coefficient is zero. The other
//! coefficients come from a singular value decomposition (Golub and Van Loan 2013, section 5.5), not from normal equations.
//! Orthogonalisation is repeated once (Bjorck 1994). Theory and choice of the threshold: `docs/law.md`.

use nalgebra::{DMatrix, DVector};

/// Result of a rank-revealing fit.
#[derive(Debug, Clone, PartialEq)]
pub struct RankRevealingFit {
    /// Coefficient of every column; zero for dropped columns.
    pub coefficients: Vec<f64>,
    /// Indices of the dropped columns.
    pub dropped: Vec<usize>,
    /// Ratio of the largest to the smallest singular value of the remaining columns.
    pub condition_number: f64,
    /// Observed minus fitted value, per row.
    pub residuals: Vec<f64>,
    /// Root mean square residual per degree of freedom; zero without degrees of freedom.
    pub residual_se: f64,
}

/// Fits `columns * coefficients` to `observed`.
///
/// A column is dropped when the root mean square of its orthogonal component is not above `min_rms`.
#[must_use]
pub fn fit(columns: &DMatrix<f64>, observed: &DVector<f64>, min_rms: f64) -> RankRevealingFit {
    let rows = columns.nrows();
    let mut basis: Vec<DVector<f64>> = Vec::new();
    let (mut retained, mut dropped) = (Vec::new(), Vec::new());
    for (index, column) in columns.column_iter().enumerate() {
        let mut remainder = column.clone_owned();
        // The second pass removes the rounding errors of the first.
        for _ in 0..2 {
            for q in &basis {
                remainder -= q * q.dot(&remainder);
            }
        }
        let norm = remainder.norm();
        if basis.len() < rows && norm / (rows as f64).sqrt() > min_rms {
            basis.push(remainder / norm);
            retained.push(index);
        } else {
            dropped.push(index);
        }
    }
    let reduced = columns.select_columns(&retained);
    let svd = reduced.clone().svd(true, true);
    // The remaining columns are independent by construction: no singular value is truncated.
    let solution = svd.solve(observed, 0.0).unwrap_or_else(|_| DVector::zeros(retained.len()));
    let residuals = observed - &reduced * &solution;
    let mut coefficients = vec![0.0; columns.ncols()];
    for (value, index) in solution.iter().zip(&retained) {
        if let Some(slot) = coefficients.get_mut(*index) {
            *slot = *value;
        }
    }
    let freedom = rows.saturating_sub(retained.len());
    let residual_se = if freedom == 0 { 0.0 } else { (residuals.norm_squared() / freedom as f64).sqrt() };
    RankRevealingFit {
        coefficients,
        dropped,
        condition_number: svd.singular_values.max() / svd.singular_values.min(),
        residuals: residuals.iter().copied().collect(),
        residual_se,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dependent_column_is_dropped_and_the_others_are_exact() {
        // Third column is the sum of the first two.
        let columns =
            DMatrix::from_row_slice(4, 3, &[1.0, 0.0, 1.0, 1.0, 1.0, 2.0, 1.0, 2.0, 3.0, 1.0, 3.0, 4.0]);
        let observed = DVector::from_row_slice(&[2.0, 5.0, 8.0, 11.0]);
        let fit = fit(&columns, &observed, 1e-9);
        assert_eq!(fit.dropped, [2]);
        assert!((fit.coefficients[0] - 2.0).abs() < 1e-12 && (fit.coefficients[1] - 3.0).abs() < 1e-12);
        assert!(fit.residual_se < 1e-12);
    }

    #[test]
    fn at_most_as_many_columns_as_rows_are_retained() {
        let columns = DMatrix::from_row_slice(2, 3, &[1.0, 0.3, 0.1, 1.0, 0.9, 0.8]);
        let fit = fit(&columns, &DVector::from_row_slice(&[1.0, 2.0]), 1e-6);
        assert_eq!(fit.dropped, [2]);
        assert!(fit.residuals.iter().all(|r| r.abs() < 1e-12));
    }
}
