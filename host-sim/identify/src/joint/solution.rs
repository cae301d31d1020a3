//! What follows from a fit: its errors, the ratios that it would have given without each point, and how hypothetical points
//! would depend on what was fitted.

use nalgebra::DMatrix;

use super::linear::{Linear, Problem, change, settled};
use super::search::Fitted;
use super::stacked::Step;
use super::{Prior, Row};
use crate::discrepancy::{Basis, Discrepancy, Shape};
use crate::ratio_model::{Change, OperatingPoint, ReducedRatio};
use kou_records::InputError;

/// The solution.
#[derive(Debug, Clone)]
pub struct Solution {
    /// Coefficients of the kept terms, then displacement and bulk modulus (relative change), then the settings.
    pub unknowns: Vec<f64>,
    /// Nominal settings below full displacement, in the order of their unknowns.
    pub settings: Vec<f64>,
    /// Coefficients of the functions beside the law; see `discrepancy`.
    pub beside: Vec<f64>,
    /// What the quadratic misses, and its functions.
    pub discrepancy: Discrepancy,
    /// Its size and length, as chosen.
    pub shape: Shape,
    /// `L` with `L L^T` the covariance of the unknowns and, behind them, of `beside`.
    pub covariance_root: DMatrix<f64>,
    /// Prior standard error of each unknown; infinite for the law.
    pub prior_se: Vec<f64>,
    /// Condition number of the whitened Jacobian with columns scaled to one.
    pub condition_number: f64,
    /// Ratio by the law and the machine as identified, per row.
    pub ratio: Vec<f64>,
    /// The same from a fit without the row.
    pub ratio_without: Vec<f64>,
    /// `dr/dKou`, per row.
    pub slope: Vec<f64>,
    /// Robust weight of each row, 1 for a row that is believed.
    pub weight: Vec<f64>,
    /// Standard error given to each row's ratio.
    pub sigma: Vec<f64>,
    /// Sum of squared whitened residuals per degree of freedom.
    pub chi2_per_freedom: f64,
}

impl Solution {
    /// The machine's change.
    #[must_use]
    pub fn change(&self) -> Change {
        change(&self.unknowns, self.unknowns.len() - 2 - self.settings.len())
    }

    /// The row's point with its displacement as identified.
    #[must_use]
    pub fn at(&self, row: &Row) -> OperatingPoint {
        settled(row, &self.unknowns, &self.settings)
    }
}

/// The solution where a fit has converged.
pub(super) fn of(
    problem: &Problem<'_>,
    mut fitted: Fitted,
    (linear, step): (Linear, Step),
    shape: Shape,
) -> Solution {
    let named = problem.named();
    let ratio_without = ratio_without(&linear, &step, &fitted.unknowns, named);
    let weight = fitted.weight;
    let squares: f64 = linear.residual.iter().zip(&weight).map(|(r, w)| w * r * r).sum();
    // What the fit can follow is not free: the trace of the leverages, the functions beside the law included.
    let freedom =
        (weight.iter().sum::<f64>() - step.leverage.iter().take(weight.len()).sum::<f64>()).max(1.0);
    let chi2_per_freedom = squares / freedom;
    // Errors larger than declared widen the covariance; smaller ones do not narrow it.
    let covariance_root = step.covariance_root * chi2_per_freedom.max(1.0).sqrt();
    let beside = fitted.unknowns.split_off(named);
    Solution {
        unknowns: fitted.unknowns,
        prior_se: problem.prior_se(named),
        settings: problem.settings.to_vec(),
        beside,
        discrepancy: linear.discrepancy,
        shape,
        covariance_root,
        condition_number: step.condition_number,
        ratio: linear.ratio,
        ratio_without,
        slope: linear.slope,
        weight,
        sigma: linear.sigma,
        chi2_per_freedom,
    }
}

/// Ratio by the law and the machine as identified, from a fit without the row, for each row.
fn ratio_without(linear: &Linear, step: &Step, unknowns: &[f64], named: usize) -> Vec<f64> {
    (0..linear.ratio.len())
        .map(|i| {
            let shift = step.shift_without.row(i);
            let derivative = |j: usize| linear.sigma[i] * linear.jacobian[(i, j)];
            let by_named: f64 = (0..named).map(|j| derivative(j) * shift[j]).sum();
            let beside: f64 = (named..shift.len()).map(|j| derivative(j) * (unknowns[j] - shift[j])).sum();
            linear.ratio[i] - by_named - linear.discrepancy.pull(i) * beside
        })
        .collect()
}

/// How the ratio at hypothetical points would depend on the unknowns and on what stands beside the law, each row divided by
/// its standard error. `unknowns` and `settings` may have more settings than the solution.
///
/// # Errors
/// A change of the machine that the estimator refuses.
pub fn sensitivities(
    rows: &[Row],
    settings: &[f64],
    reduced: &ReducedRatio,
    solution: &Solution,
    unknowns: &[f64],
    prior: &Prior,
) -> Result<DMatrix<f64>, InputError> {
    let kept = unknowns.len() - 2 - settings.len();
    let correction = vec![0.0; rows.len()];
    let problem = Problem { rows, reduced, correction: &correction, prior: *prior, settings, kept };
    let linear = problem.linearise(unknowns, &Basis::over(&[], 1.0), Shape { size: 0.0, length: 1.0 })?;
    let (named, beside) = (unknowns.len(), solution.beside.len());
    let mut jacobian = linear.jacobian.resize_horizontally(named + beside, 0.0);
    for (i, row) in rows.iter().enumerate() {
        let kou: f64 = row.phi.iter().zip(unknowns).map(|(f, k)| f * k).sum();
        for (j, f) in solution.discrepancy.at(&row.x, &row.phi, kou).kou.iter().enumerate() {
            jacobian[(i, named + j)] = linear.slope[i] * f / linear.sigma[i];
        }
    }
    Ok(jacobian)
}
