//! Outer iteration of the joint scheme: joint fits with the reduced model, corrected by the plant model.
//!
//! Every round fits with the current correction per point, solves the plant model once per point at the solution, and updates
//! the corrections: a fixed-point iteration with the reduced model as surrogate (space mapping: Bandler et al. 1994). The
//! corrections hardly depend on the parameters, so that two or three rounds converge.

use kou_records::InputError;
use rayon::prelude::*;

use crate::joint::{self, JointSolution, Observation, Prior};
use crate::plant_model::{PlantError, PlantModel};
use crate::reduced_plant::ReducedPlant;

/// Convergence tolerance of the corrections, in ratio: half the default tolerance of the secant method.
const CORRECTION_TOL: f64 = 5e-5;
/// Maximum number of rounds.
const MAX_ROUNDS: u32 = 6;
/// Minimum leakage coefficient for which the plant model is solved.
const MIN_KOU: f64 = 1e-4;

/// Result of the outer iteration.
pub(crate) struct OuterFit {
    pub(crate) solution: JointSolution,
    /// Rows at which the plant model failed.
    pub(crate) failed: Vec<(usize, PlantError)>,
    /// Plant-model calls.
    pub(crate) calls: u32,
}

/// Iterates fit and correction until the corrections converge; one fit without a plant model.
///
/// # Errors
/// A machine correction rejected by the estimator or the plant model.
pub(crate) fn iterate(
    rows: &[Observation],
    reduced: &ReducedPlant,
    model: Option<&dyn PlantModel>,
    prior: &Prior,
) -> Result<OuterFit, InputError> {
    let mut correction = vec![0.0; rows.len()];
    let mut solution = joint::fit(rows, reduced, &correction, prior, None)?;
    let (mut failed, mut calls) = (Vec::new(), 0);
    let Some(model) = model else { return Ok(OuterFit { solution, failed, calls }) };
    for _ in 0..MAX_ROUNDS {
        let machine = solution.correction();
        let (plant, reduced_here) = (model.corrected(machine)?, reduced.with_correction(machine)?);
        calls += u32::try_from(rows.len()).unwrap_or(u32::MAX);
        let solved: Vec<Result<f64, PlantError>> = rows
            .par_iter()
            .map(|row| {
                let at = solution.at(row);
                let kou = row.kou(&solution.unknowns).max(MIN_KOU);
                plant.solve(&at, kou).map(|s| s.ratio - reduced_here.ratio(&at, kou))
            })
            .collect();
        let mut moved: f64 = 0.0;
        for (i, (slot, result)) in correction.iter_mut().zip(solved).enumerate() {
            match result {
                Ok(value) => {
                    moved = moved.max((value - *slot).abs());
                    *slot = value;
                }
                Err(error) => failed.push((i, error)),
            }
        }
        if !failed.is_empty() {
            break;
        }
        solution = joint::fit(rows, reduced, &correction, prior, Some(&solution))?;
        if moved < CORRECTION_TOL {
            break;
        }
    }
    Ok(OuterFit { solution, failed, calls })
}
