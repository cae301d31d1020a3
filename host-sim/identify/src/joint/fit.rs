//! The joint fit: first fit without discrepancy, selection of the kernel, final fit.

use kou_records::InputError;

use crate::discrepancy::{Basis, Kernel};
use crate::joint::linear::{FitState, JointProblem, partial_settings};
use crate::joint::observation::Observation;
use crate::joint::prior::Prior;
use crate::joint::solution::JointSolution;
use crate::reduced_plant::ReducedPlant;

/// Relative misfit in the first fit, which has no discrepancy: error of a quadratic law for a physical leakage.
const FIRST_MISFIT: f64 = 0.018;
/// Maximum number of kernel selections; they usually agree after one or two.
const MAX_SELECTIONS: usize = 3;

/// Fits all unknowns. `correction` is the difference between the ratios of plant model and reduced model, per row. An earlier
/// solution for the same rows serves as start, and its kernel is reused.
///
/// # Errors
/// A machine correction rejected by the estimator.
pub fn fit(
    rows: &[Observation],
    reduced: &ReducedPlant,
    correction: &[f64],
    prior: &Prior,
    start: Option<&JointSolution>,
) -> Result<JointSolution, InputError> {
    let settings = partial_settings(rows);
    let law_terms = rows.first().map_or(0, |r| r.phi.len());
    let problem = JointProblem { rows, reduced, correction, prior: *prior, settings: &settings, law_terms };
    let points: Vec<[f64; 3]> = rows.iter().map(|r| r.x).collect();
    let mut state = FitState { unknowns: vec![0.0; problem.parameters()], weight: vec![1.0; rows.len()] };
    let mut kernel = Kernel::NONE;
    let mut converged;
    if let Some(start) = start {
        state.unknowns.clone_from(&start.unknowns);
        kernel = start.kernel;
        converged = problem.converge(&mut state, &Basis::over(&points, kernel.length_scale), kernel)?;
    } else {
        let first = Prior { misfit: prior.misfit.max(FIRST_MISFIT), ..*prior };
        converged =
            JointProblem { prior: first, ..problem }.converge(&mut state, &Basis::over(&[], 1.0), kernel)?;
        for _ in 0..MAX_SELECTIONS {
            let selected = problem.select_hyperparameters(&state, &points)?;
            if selected == kernel {
                break;
            }
            kernel = selected;
            converged = problem.converge(&mut state, &Basis::over(&points, kernel.length_scale), kernel)?;
        }
    }
    Ok(JointSolution::new(&problem, state, converged, kernel))
}
