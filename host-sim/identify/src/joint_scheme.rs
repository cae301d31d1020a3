//! Joint scheme, the default: law and machine parameters fitted together ([`joint`](crate::joint)).
//!
//! Points with a measured ratio above the leak-free ratio of the corrected machine are rejected and the others are fitted
//! again. Finally the surrogate is fitted to the plant model of the corrected machine.

use kou_estimator::Params;
use kou_records::{BenchPoint, InputError};

use crate::calibration::{CalibrationSettings, assemble};
use crate::convert::{operating_point, single};
use crate::envelope::Envelope;
use crate::error_factor::error_factor;
use crate::identification::{
    FittedParameter, Identification, PointResult, RejectedPoint, ratio_by_law, ratio_error_mean_pct,
    require_points,
};
use crate::joint::{JointSolution, Observation, Prior};
use crate::law_fit::{LawFit, TERMS};
use crate::machine_parameters::MachineParameters;
use crate::outer_fit::{self, OuterFit};
use crate::plant_model::PlantModel;
use crate::reduced_plant::ReducedPlant;
use crate::surrogate;

/// Identifies law and machine parameters together; with the reduced model alone if `model` is `None`.
///
/// # Errors
/// No point with a ratio that leakage explains, or a calibration rejected by the estimator.
pub fn identify(
    machine: impl Into<MachineParameters>,
    points: &[BenchPoint],
    settings: &CalibrationSettings,
    model: Option<&dyn PlantModel>,
    prior: &Prior,
) -> Result<Identification, InputError> {
    let machine = machine.into();
    let reduced = ReducedPlant::new(&machine)?;
    let mut used: Vec<BenchPoint> = points.to_vec();
    let mut rejected: Vec<RejectedPoint> = Vec::new();
    let mut calls = 0;
    let (fit, rows, solution) = loop {
        require_points(used.len(), &rejected)?;
        let fit = initial_law(&reduced, &used);
        let rows: Vec<Observation> =
            used.iter().map(|p| Observation::new(&fit, operating_point(p), p.ratio)).collect();
        let OuterFit { solution, failed, calls: more } = outer_fit::iterate(&rows, &reduced, model, prior)?;
        calls += more;
        let mut out: Vec<(usize, RejectedPoint)> = failed
            .into_iter()
            .map(|(i, error)| {
                (i, RejectedPoint { point: used[i], reason: error.to_string(), leak_free_ratio: None })
            })
            .collect();
        if out.is_empty() {
            out = above_leak_free(&rows, &solution, &used);
        }
        if out.is_empty() {
            break (fit, rows, solution);
        }
        let indices: Vec<usize> = out.iter().map(|(i, _)| *i).collect();
        rejected.extend(out.into_iter().map(|(_, point)| point));
        used = used.iter().enumerate().filter(|(i, _)| !indices.contains(i)).map(|(_, p)| *p).collect();
    };
    rejected.sort_by_key(|r| r.point.line);

    let fit = with_solution(fit, &rows, &solution);
    let correction = solution.correction();
    let corrected = machine.corrected(correction)?;
    let surrogate = match model {
        Some(model) => {
            calls += surrogate::POINTS;
            Some(surrogate::fit(&corrected, model.corrected(correction)?.as_ref(), &envelope_of(&used))?)
        }
        None => None,
    };
    let theory = reduced.configs(correction);
    let config = surrogate.as_ref().map_or(theory.0, |s| s.config);
    let mut calibration = assemble(&machine, config, fit.law, fit.region, used.len(), settings)?;
    calibration.oil = theory.1;
    if let Some(surrogate) = &surrogate {
        calibration.machine.low_pressure.0 = single(surrogate.low_pressure_mpa);
    }
    let params = Params::new(&calibration)
        .map_err(|e| InputError::new(format!("the estimator rejects the identified calibration: {e}")))?;
    let points = results(&used, &rows, &solution, &fit, &params);
    let ratio_error_mean_pct = ratio_error_mean_pct(&points);
    Ok(Identification {
        calibration,
        points,
        rejected,
        ratio_error_mean_pct,
        parameters: fitted_parameters(&fit, &solution),
        correlation: correlation(&solution),
        chi2_per_freedom: solution.chi2_per_freedom,
        correction,
        surrogate,
        model_calls: calls,
        solution: Some(solution),
        fit,
    })
}

/// Initial law: normalisers, region and determined terms, from the points and their coefficients by the reduced model.
fn initial_law(reduced: &ReducedPlant, points: &[BenchPoint]) -> LawFit {
    let by_inverse: Vec<[f64; 4]> = points
        .iter()
        .map(|p| [p.n_p_rpm, p.p_h_mpa, p.t_b_c, reduced.kou(&operating_point(p), p.ratio)])
        .collect();
    LawFit::new(&by_inverse)
}

/// Leakage coefficient from the measured ratio of a row, for the corrected machine.
fn measured_kou(row: &Observation, i: usize, solution: &JointSolution) -> f64 {
    row.kou(&solution.unknowns) + (row.ratio - solution.ratio[i]) / solution.slope[i]
}

/// Rows with a measured ratio above the leak-free ratio of the corrected machine.
fn above_leak_free(
    rows: &[Observation],
    solution: &JointSolution,
    used: &[BenchPoint],
) -> Vec<(usize, RejectedPoint)> {
    rows.iter()
        .enumerate()
        .filter(|(i, row)| measured_kou(row, *i, solution) < 0.0)
        .map(|(i, row)| {
            let kou_law = row.kou(&solution.unknowns);
            let leak_free_ratio = solution.ratio[i] - solution.slope[i] * kou_law;
            (i, RejectedPoint::above_leak_free(used[i], leak_free_ratio))
        })
        .collect()
}

/// Law with the coefficients of a solution, their covariance and the misfit.
fn with_solution(mut fit: LawFit, rows: &[Observation], solution: &JointSolution) -> LawFit {
    let terms = fit.determined_terms();
    let mut all = [0.0_f32; 10];
    for (i, value) in terms.iter().zip(&solution.unknowns) {
        all[*i] = single(*value);
    }
    let law = &mut fit.law;
    [law.c, law.b1, law.b2, law.b3, law.a11, law.a22, law.a33, law.a12, law.a13, law.a23] = all;
    // Misfit: residuals in Kou, weighted by the precision of each ratio.
    let (mut sum, mut weights) = (0.0, 0.0);
    for (i, row) in rows.iter().enumerate() {
        let weight = solution.weight[i] * (solution.slope[i] / solution.sigma[i]).powi(2);
        let misfit = (row.ratio - solution.ratio[i]) / solution.slope[i];
        sum += weight * misfit * misfit;
        weights += weight;
    }
    let freedom = rows.len().saturating_sub(terms.len()).max(1);
    let misfit = (sum / weights * rows.len() as f64 / freedom as f64).sqrt();
    law.residual_se.0 = single(misfit).min(10.0);
    law.covariance_factor = error_factor(&solution.covariance_factor, &terms, rows, &fit.region);
    fit.condition_number = solution.condition_number;
    fit
}

/// Parameters of a solution with names and standard errors.
fn fitted_parameters(fit: &LawFit, solution: &JointSolution) -> Vec<FittedParameter> {
    let mut names: Vec<String> =
        fit.determined_terms().iter().filter_map(|i| TERMS.get(*i)).map(ToString::to_string).collect();
    names.extend(["displacement".to_string(), "bulk_modulus".to_string()]);
    names.extend(solution.settings.iter().map(|s| format!("alpha_{s:.2}")));
    names
        .into_iter()
        .enumerate()
        .map(|(i, name)| FittedParameter {
            name,
            value: solution.unknowns[i],
            se: solution.covariance_factor.row(i).norm(),
            prior_se: Some(solution.prior_se[i]).filter(|p| p.is_finite()),
        })
        .collect()
}

/// Correlation matrix of the parameters.
fn correlation(solution: &JointSolution) -> Vec<Vec<f64>> {
    let factor = solution.covariance_factor.rows(0, solution.unknowns.len());
    let covariance = factor * factor.transpose();
    let se: Vec<f64> =
        (0..factor.nrows()).map(|i| covariance[(i, i)].sqrt().max(f64::MIN_POSITIVE)).collect();
    (0..factor.nrows())
        .map(|i| (0..factor.nrows()).map(|j| covariance[(i, j)] / (se[i] * se[j])).collect())
        .collect()
}

/// Envelope of the bench points, with displacements from 0.3 or the smallest measured one.
fn envelope_of(points: &[BenchPoint]) -> Envelope {
    let range = |of: fn(&BenchPoint) -> f64| {
        let values = points.iter().map(of);
        [values.clone().fold(f64::INFINITY, f64::min), values.fold(f64::NEG_INFINITY, f64::max)]
    };
    let alpha = range(|p| p.alpha.abs());
    Envelope {
        speed_rpm: range(|p| p.n_p_rpm),
        pressure_mpa: range(|p| p.p_h_mpa),
        temperature_c: range(|p| p.t_b_c),
        alpha: [alpha[0].min(Envelope::default().alpha[0]), 1.0],
        ..Envelope::default()
    }
}

/// Results per point.
fn results(
    used: &[BenchPoint],
    rows: &[Observation],
    solution: &JointSolution,
    fit: &LawFit,
    params: &Params,
) -> Vec<PointResult> {
    let low_mpa = f64::from(params.low_pressure().get());
    used.iter()
        .zip(rows)
        .enumerate()
        .map(|(i, (point, row))| {
            let kou_law = row.kou(&solution.unknowns);
            let factor = solution.covariance_factor.rows(0, row.phi.len());
            let of_coefficients = (nalgebra::RowDVector::from_row_slice(&row.phi) * factor).norm();
            PointResult {
                point: *point,
                kou: measured_kou(row, i, solution),
                kou_law,
                kou_law_se: of_coefficients.hypot(f64::from(fit.law.residual_se.get())),
                ratio_by_law: ratio_by_law(params, &solution.at(row), low_mpa),
                leave_one_out: solution.ratio_without[i] / row.ratio - 1.0,
                weight: solution.weight[i],
                calls: 0,
            }
        })
        .collect()
}
