//! Rank-revealing linear least squares by orthogonalisation.
//!
//! Columns are taken in the order given. A column that, after the earlier ones are projected out of it, has too little
//! of itself left is not determined by the data: it is dropped, its coefficient is zero, and the caller is told. The
//! kept columns are solved for by a singular value decomposition, never by normal equations. The order matters: the
//! caller puts first what it would rather keep. Theory and the choice of threshold: `docs/law.md`.

use nalgebra::{DMatrix, DVector};

/// Result of a fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Fit {
    /// Coefficient of every column; zero for the dropped ones.
    pub coefficients: Vec<f64>,
    /// Indices of the dropped columns.
    pub dropped: Vec<usize>,
    /// Ratio of the largest to the smallest singular value of the kept columns.
    pub condition_number: f64,
    /// Observed minus fitted, per row.
    pub residuals: Vec<f64>,
    /// Root mean square residual per degree of freedom; zero without degrees of freedom.
    pub residual_se: f64,
}

/// Fits `columns * coefficients` to `observed`.
///
/// `min_rms` is the root mean square over the rows that a column must keep after projection.
#[must_use]
pub fn fit(columns: &DMatrix<f64>, observed: &DVector<f64>, min_rms: f64) -> Fit {
    let rows = columns.nrows();
    let mut basis: Vec<DVector<f64>> = Vec::new();
    let (mut kept, mut dropped) = (Vec::new(), Vec::new());
    for (index, column) in columns.column_iter().enumerate() {
        let mut rest = column.clone_owned();
        // Twice: the second pass removes what rounding left of the first.
        for _ in 0..2 {
            for q in &basis {
                rest -= q * q.dot(&rest);
            }
        }
        let norm = rest.norm();
        if basis.len() < rows && norm / (rows as f64).sqrt() > min_rms {
            basis.push(rest / norm);
            kept.push(index);
        } else {
            dropped.push(index);
        }
    }
    let reduced = columns.select_columns(&kept);
    let svd = reduced.clone().svd(true, true);
    // The kept columns are independent by construction: no singular value is cut off here.
    let solution = svd.solve(observed, 0.0).unwrap_or_else(|_| DVector::zeros(kept.len()));
    let residuals = observed - &reduced * &solution;
    let mut coefficients = vec![0.0; columns.ncols()];
    for (value, index) in solution.iter().zip(&kept) {
        if let Some(slot) = coefficients.get_mut(*index) {
            *slot = *value;
        }
    }
    let freedom = rows.saturating_sub(kept.len());
    let residual_se = if freedom == 0 { 0.0 } else { (residuals.norm_squared() / freedom as f64).sqrt() };
    Fit {
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
    fn dependent_column_is_dropped_and_the_rest_is_exact() {
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
    fn fewer_rows_than_columns_keeps_no_more_than_the_rows() {
        let columns = DMatrix::from_row_slice(2, 3, &[1.0, 0.3, 0.1, 1.0, 0.9, 0.8]);
        let fit = fit(&columns, &DVector::from_row_slice(&[1.0, 2.0]), 1e-6);
        assert_eq!(fit.dropped, [2]);
        assert!(fit.residuals.iter().all(|r| r.abs() < 1e-12));
    }
}
