//! The paper's scheme: Kou of each point by itself, then the law through the coefficients (eqs. 8 to 18, fig. 9).
//!
//! With the reduced model each point is its closed-form inverse; with a better model it is the safeguarded secant, points
//! in parallel, started from the reduced model's inverse. Whatever is wrong in the machine file goes into Kou here.

use kou_estimator::Params;
use rayon::prelude::*;

use super::law_fit::LawFit;
use super::outcome::{
    Identification, PointResult, Refusal, demand_points, evaluate, ratio_by_law, ratio_error_mean_pct,
};
use super::ratio_model::{Change, RatioModel, ReducedRatio, operating_point};
use super::secant::{self, Found, NotFound, Secant};
use crate::calibration::{Settings, assemble, reduced_config};
use kou_lumped::machine::Machine;
use kou_records::BenchPoint;
use kou_records::InputError;

/// Half the default start interval about the reduced model's inverse, relative: what the reduced model is good for.
const WARM: f64 = 0.02;

/// Identifies a law; with the reduced model where `model` is none.
///
/// # Errors
/// When no point can be explained by leakage, or the estimator refuses the resulting calibration.
pub fn identify(
    machine: &Machine,
    points: &[BenchPoint],
    settings: &Settings,
    model: Option<&dyn RatioModel>,
    how: &Secant,
) -> Result<Identification, InputError> {
    let reduced = ReducedRatio::new(machine)?;
    let solve = |point: &BenchPoint| -> Result<Found, NotFound> {
        let at = operating_point(point);
        let inverse = reduced.kou(&at, point.ratio);
        match model {
            Some(model) => {
                let warm = inverse.max(1e-3);
                let start = how.start.unwrap_or([warm * (1.0 - WARM), warm * (1.0 + WARM)]);
                secant::solve(model, &at, point.ratio, start, how)
            }
            None if inverse >= 0.0 => Ok(Found { kou: inverse, ratio: point.ratio, calls: 1 }),
            None => Err(NotFound::AboveLeakFree { leak_free_ratio: reduced.ratio(&at, 0.0) }),
        }
    };
    let solved: Vec<_> = points.par_iter().map(|point| (*point, solve(point))).collect();
    let (mut explained, mut refused) = (Vec::new(), Vec::new());
    for (point, result) in solved {
        match result {
            Ok(found) => explained.push((point, found)),
            Err(NotFound::AboveLeakFree { leak_free_ratio }) => {
                refused.push(Refusal::above_leak_free(point, leak_free_ratio));
            }
            Err(NotFound::TooManyCalls { error }) => refused.push(Refusal {
                point,
                reason: format!("not converged, relative error of the ratio {error:.1e}"),
                leak_free_ratio: None,
            }),
            Err(NotFound::Model(error)) => {
                refused.push(Refusal { point, reason: error.to_string(), leak_free_ratio: None });
            }
        }
    }
    demand_points(explained.len(), &refused)?;
    let coordinates: Vec<[f64; 4]> =
        explained.iter().map(|(p, found)| [p.n_p_rpm, p.p_h_mpa, p.t_b_c, found.kou]).collect();
    let fit = LawFit::new(&coordinates);
    let calibration =
        assemble(machine, reduced_config(machine), fit.law, fit.region, explained.len(), settings)?;
    let params = Params::new(&calibration)
        .map_err(|e| InputError::new(format!("the estimator refuses the identified calibration: {e}")))?;
    let low_mpa = machine.circuit().low_pressure_mpa;
    let model_calls = if model.is_some() { explained.iter().map(|(_, f)| f.calls).sum() } else { 0 };
    let points: Vec<PointResult> = explained
        .into_iter()
        .map(|(point, found)| {
            let at = operating_point(&point);
            let kou_law = evaluate(&fit, &point);
            // What the law misses here, carried to the ratio by the reduced model's slope where a full model was used.
            let ratio_by_law = if model.is_some() {
                found.ratio + reduced.slope(&at) * at.alpha.signum() * (kou_law - found.kou)
            } else {
                ratio_by_law(&params, &at, low_mpa)
            };
            PointResult {
                point,
                kou: found.kou,
                kou_law,
                kou_law_se: f64::from(fit.law.residual_se.get()),
                ratio_by_law,
                leave_one_out: ratio_by_law / point.ratio - 1.0,
                weight: 1.0,
                calls: found.calls,
            }
        })
        .collect();
    let ratio_error_mean_pct = ratio_error_mean_pct(&points);
    Ok(Identification {
        calibration,
        fit,
        points,
        refused,
        ratio_error_mean_pct,
        unknowns: Vec::new(),
        correlation: Vec::new(),
        chi2_per_freedom: 0.0,
        change: Change::NONE,
        surrogate: None,
        model_calls,
        solution: None,
    })
}
