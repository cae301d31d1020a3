//! Two-step scheme of the paper: leakage coefficient of each point, then a least-squares law (Wang et al., eqs. 8-18, fig. 9).
//!
//! Without a plant model a point is solved by the closed-form inverse of the reduced model; with one by the safeguarded
//! secant method, started from that inverse, points in parallel. Errors of the machine file are not separated from leakage.

use kou_estimator::Params;
use rayon::prelude::*;

use kou_records::{BenchPoint, InputError};

use crate::calibration::{CalibrationSettings, assemble};
use crate::convert::operating_point;
use crate::identification::{
    Identification, PointResult, RejectedPoint, ratio_by_law, ratio_error_mean_pct, require_points,
};
use crate::law_fit::LawFit;
use crate::machine_parameters::MachineParameters;
use crate::plant_model::{MachineCorrection, PlantModel};
use crate::reduced_plant::ReducedPlant;
use crate::secant::{self, SecantError, SecantSettings, SecantSolution};

/// Half width of the default start interval around the reduced model's inverse, relative.
const START_HALF_WIDTH: f64 = 0.02;

/// Identifies a law; with the reduced model if `model` is `None`.
///
/// # Errors
/// No point with a ratio that leakage explains, or a calibration rejected by the estimator.
pub fn identify(
    machine: impl Into<MachineParameters>,
    points: &[BenchPoint],
    settings: &CalibrationSettings,
    model: Option<&dyn PlantModel>,
    secant: &SecantSettings,
) -> Result<Identification, InputError> {
    let machine = machine.into();
    let reduced = ReducedPlant::new(&machine)?;
    let solve = |point: &BenchPoint| -> Result<SecantSolution, SecantError> {
        let at = operating_point(point);
        let inverse = reduced.kou(&at, point.ratio);
        match model {
            Some(model) => {
                let warm = inverse.max(1e-3);
                let start = secant
                    .start
                    .unwrap_or([warm * (1.0 - START_HALF_WIDTH), warm * (1.0 + START_HALF_WIDTH)]);
                secant::solve(model, &at, point.ratio, start, secant)
            }
            None if inverse >= 0.0 => Ok(SecantSolution { kou: inverse, ratio: point.ratio, calls: 1 }),
            None => Err(SecantError::AboveLeakFree { leak_free_ratio: reduced.ratio(&at, 0.0) }),
        }
    };
    let solved: Vec<_> = points.par_iter().map(|point| (*point, solve(point))).collect();
    let (mut explained, mut rejected) = (Vec::new(), Vec::new());
    for (point, result) in solved {
        match result {
            Ok(solution) => explained.push((point, solution)),
            Err(SecantError::AboveLeakFree { leak_free_ratio }) => {
                rejected.push(RejectedPoint::above_leak_free(point, leak_free_ratio));
            }
            Err(SecantError::TooManyCalls { error }) => rejected.push(RejectedPoint {
                point,
                reason: format!("not converged, relative error of the ratio {error:.1e}"),
                leak_free_ratio: None,
            }),
            Err(SecantError::Plant(error)) => {
                rejected.push(RejectedPoint { point, reason: error.to_string(), leak_free_ratio: None });
            }
        }
    }
    require_points(explained.len(), &rejected)?;
    let coordinates: Vec<[f64; 4]> =
        explained.iter().map(|(p, solution)| [p.n_p_rpm, p.p_h_mpa, p.t_b_c, solution.kou]).collect();
    let fit = LawFit::new(&coordinates);
    let calibration =
        assemble(&machine, machine.reduced_config(), fit.law, fit.region, explained.len(), settings)?;
    let params = Params::new(&calibration)
        .map_err(|e| InputError::new(format!("the estimator rejects the identified calibration: {e}")))?;
    let low_mpa = machine.low_pressure_mpa;
    let model_calls = if model.is_some() { explained.iter().map(|(_, s)| s.calls).sum() } else { 0 };
    let points: Vec<PointResult> = explained
        .into_iter()
        .map(|(point, solution)| {
            let at = operating_point(&point);
            let kou_law = fit.kou(&point);
            // With a plant model: misfit of the law, converted to the ratio with the reduced model's slope.
            let ratio_by_law = if model.is_some() {
                solution.ratio + reduced.slope(&at) * at.alpha.signum() * (kou_law - solution.kou)
            } else {
                ratio_by_law(&params, &at, low_mpa)
            };
            PointResult {
                point,
                kou: solution.kou,
                kou_law,
                kou_law_se: f64::from(fit.law.residual_se.get()),
                ratio_by_law,
                leave_one_out: ratio_by_law / point.ratio - 1.0,
                weight: 1.0,
                calls: solution.calls,
            }
        })
        .collect();
    let ratio_error_mean_pct = ratio_error_mean_pct(&points);
    Ok(Identification {
        calibration,
        fit,
        points,
        rejected,
        ratio_error_mean_pct,
        parameters: Vec::new(),
        correlation: Vec::new(),
        chi2_per_freedom: 0.0,
        correction: MachineCorrection::NONE,
        surrogate: None,
        model_calls,
        solution: None,
    })
}
