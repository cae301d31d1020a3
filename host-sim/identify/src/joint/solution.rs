//! Solution of a joint fit: covariance, leave-one-out ratios, and sensitivities of hypothetical points.

use nalgebra::DMatrix;

use kou_lumped::OperatingPoint;
use kou_records::InputError;

use crate::discrepancy::{Basis, Discrepancy, Kernel};
use crate::joint::least_squares::GaussNewtonStep;
use crate::joint::linear::{FitState, JointProblem, LinearisedModel, identified_point, machine_correction};
use crate::joint::observation::Observation;
use crate::joint::prior::Prior;
use crate::plant_model::MachineCorrection;
use crate::reduced_plant::ReducedPlant;

/// Solution of a joint fit.
#[derive(Debug, Clone)]
pub struct JointSolution {
    /// Parameters: coefficients of the law, then relative corrections of displacement, bulk modulus and settings.
    pub unknowns: Vec<f64>,
    /// Nominal displacement settings below full, in the order of their unknowns.
    pub settings: Vec<f64>,
    /// Coefficients of the discrepancy's basis functions.
    pub discrepancy_coefficients: Vec<f64>,
    /// Discrepancy of the quadratic law.
    pub discrepancy: Discrepancy,
    /// Selected kernel of the discrepancy.
    pub kernel: Kernel,
    /// Factor `L` of the covariance `L L^T` of the parameters, followed by the discrepancy coefficients.
    pub covariance_factor: DMatrix<f64>,
    /// Prior standard error of each parameter; infinite for the law.
    pub prior_se: Vec<f64>,
    /// Condition number of the whitened Jacobian with unit columns.
    pub condition_number: f64,
    /// Ratio by the law and the corrected machine, per row.
    pub ratio: Vec<f64>,
    /// Ratio by a fit without the row, per row.
    pub ratio_without: Vec<f64>,
    /// Derivative `dr/dKou`, per row.
    pub slope: Vec<f64>,
    /// Robust weight, 1 for an inlier, per row.
    pub weight: Vec<f64>,
    /// Standard error assigned to the ratio, per row.
    pub sigma: Vec<f64>,
    /// Reduced chi-squared: sum of squared whitened residuals per degree of freedom.
    pub chi2_per_freedom: f64,
}

impl JointSolution {
    /// Identified correction of the machine file.
    #[must_use]
    pub fn correction(&self) -> MachineCorrection {
        machine_correction(&self.unknowns, self.unknowns.len() - 2 - self.settings.len())
    }

    /// Operating point of a row with the identified displacement setting.
    #[must_use]
    pub fn at(&self, row: &Observation) -> OperatingPoint {
        identified_point(row, &self.unknowns, &self.settings)
    }

    /// Solution of a converged fit.
    pub(super) fn new(
        problem: &JointProblem<'_>,
        mut state: FitState,
        (linear, step): (LinearisedModel, GaussNewtonStep),
        kernel: Kernel,
    ) -> Self {
        let parameters = problem.parameters();
        let ratio_without = ratio_without(&linear, &step, &state.unknowns, parameters);
        let weight = state.weight;
        let squares: f64 = linear.residual.iter().zip(&weight).map(|(r, w)| w * r * r).sum();
        // Effective degrees of freedom: sum of weights minus trace of the hat matrix, discrepancy coefficients included.
        let freedom =
            (weight.iter().sum::<f64>() - step.leverage.iter().take(weight.len()).sum::<f64>()).max(1.0);
        let chi2_per_freedom = squares / freedom;
        // A reduced chi-squared above one scales the covariance; one below does not.
        let covariance_factor = step.covariance_factor * chi2_per_freedom.max(1.0).sqrt();
        let discrepancy_coefficients = state.unknowns.split_off(parameters);
        Self {
            unknowns: state.unknowns,
            prior_se: problem.prior_se(parameters),
            settings: problem.settings.to_vec(),
            discrepancy_coefficients,
            discrepancy: linear.discrepancy,
            kernel,
            covariance_factor,
            condition_number: step.condition_number,
            ratio: linear.ratio,
            ratio_without,
            slope: linear.slope,
            weight,
            sigma: linear.sigma,
            chi2_per_freedom,
        }
    }
}

/// Leave-one-out ratios: ratio by the law and the corrected machine from a fit without the row, for each row.
fn ratio_without(
    linear: &LinearisedModel,
    step: &GaussNewtonStep,
    unknowns: &[f64],
    parameters: usize,
) -> Vec<f64> {
    (0..linear.ratio.len())
        .map(|i| {
            let shift = step.leave_one_out_shift.row(i);
            let derivative = |j: usize| linear.sigma[i] * linear.jacobian[(i, j)];
            let by_parameters: f64 = (0..parameters).map(|j| derivative(j) * shift[j]).sum();
            let by_discrepancy: f64 =
                (parameters..shift.len()).map(|j| derivative(j) * (unknowns[j] - shift[j])).sum();
            linear.ratio[i] - by_parameters - linear.discrepancy.leave_one_out_gain(i) * by_discrepancy
        })
        .collect()
}

/// Whitened Jacobian of the ratio at hypothetical points with respect to parameters and discrepancy coefficients. `unknowns`
/// and `settings` may have more settings than the solution.
///
/// # Errors
/// A machine correction rejected by the estimator.
pub fn sensitivities(
    rows: &[Observation],
    settings: &[f64],
    reduced: &ReducedPlant,
    solution: &JointSolution,
    unknowns: &[f64],
    prior: &Prior,
) -> Result<DMatrix<f64>, InputError> {
    let law_terms = unknowns.len() - 2 - settings.len();
    let correction = vec![0.0; rows.len()];
    let problem = JointProblem { rows, reduced, correction: &correction, prior: *prior, settings, law_terms };
    let linear = problem.linearise(unknowns, &Basis::over(&[], 1.0), Kernel::NONE)?;
    let parameters = unknowns.len();
    let columns = parameters + solution.discrepancy_coefficients.len();
    let mut jacobian = linear.jacobian.resize_horizontally(columns, 0.0);
    for (i, row) in rows.iter().enumerate() {
        let kou = row.kou(unknowns);
        for (j, f) in solution.discrepancy.at(&row.x, &row.phi, kou).kou.iter().enumerate() {
            jacobian[(i, parameters + j)] = linear.slope[i] * f / linear.sigma[i];
        }
    }
    Ok(jacobian)
}
