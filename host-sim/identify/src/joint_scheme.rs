//! The default scheme: everything fitted together, with the full model as a correction to the reduced one.
//!
//! Rounds of: fit with the reduced model plus a correction per point ([`joint`]); solve the full model once per point at
//! the solution; renew the corrections. The corrections hardly depend on what is fitted (the surrogate's whole error is
//! 1e-3), so two or three rounds settle them. Points that no leakage explains on the machine as identified are left out
//! and the rest is fitted again. Last, the surrogate is fitted to the full model of the machine as identified.

use kou_estimator::Params;
use kou_estimator::model::calibrated_region::{Bound, RegionConfig};
use kou_estimator::model::leakage_law::LawCovarianceFactor;
use kou_estimator::units::LeakageCoefficient;
use nalgebra::DMatrix;
use rayon::prelude::*;

use super::envelope::Envelope;
use super::joint::{self, Prior, Row, Solution};
use super::law_fit::{LawFit, TERMS, normalised, phi};
use super::outcome::{
    Identification, PointResult, Refusal, Unknown, demand_points, ratio_by_law, ratio_error_mean_pct,
};
use super::ratio_model::{RatioModel, ReducedRatio, operating_point};
use super::surrogate;
use crate::calibration::{Settings, assemble};
use kou_lumped::SimError;
use kou_lumped::machine::Machine;
use kou_records::BenchPoint;
use kou_records::InputError;

/// Largest change of a correction, in ratio, at which the rounds end: half the default tolerance of the secant.
const SETTLED: f64 = 5e-5;
const MOST_ROUNDS: u32 = 6;
/// The full model is not asked for less leakage than this.
const LEAST_KOU: f64 = 1e-4;

/// Identifies law and machine together; with the reduced model alone where `model` is none.
///
/// # Errors
/// When no point can be explained by leakage, or the estimator refuses the resulting calibration.
pub fn identify(
    machine: &Machine,
    points: &[BenchPoint],
    settings: &Settings,
    model: Option<&dyn RatioModel>,
    prior: &Prior,
) -> Result<Identification, InputError> {
    let reduced = ReducedRatio::new(machine)?;
    let mut used: Vec<BenchPoint> = points.to_vec();
    let mut refused: Vec<Refusal> = Vec::new();
    let mut calls = 0;
    let (fit, rows, solution) = loop {
        demand_points(used.len(), &refused)?;
        let fit = shape_of_law(&reduced, &used);
        let rows = rows_of(&fit, &used);
        let Settled { solution, failed, calls: more } = settle(&rows, &reduced, model, prior)?;
        calls += more;
        let mut out: Vec<(usize, Refusal)> = failed
            .into_iter()
            .map(|(i, error)| {
                (i, Refusal { point: used[i], reason: error.to_string(), leak_free_ratio: None })
            })
            .collect();
        if out.is_empty() {
            out = unexplained(&rows, &solution, &used);
        }
        if out.is_empty() {
            break (fit, rows, solution);
        }
        let indices: Vec<usize> = out.iter().map(|(i, _)| *i).collect();
        refused.extend(out.into_iter().map(|(_, refusal)| refusal));
        used = used.iter().enumerate().filter(|(i, _)| !indices.contains(i)).map(|(_, p)| *p).collect();
    };
    refused.sort_by_key(|r| r.point.line);

    let fit = with_solution(fit, &rows, &solution);
    let change = solution.change();
    let changed = change.of(machine)?;
    let surrogate = match model {
        Some(model) => {
            calls += surrogate::POINTS;
            Some(surrogate::fit(&changed, model.changed(change)?.as_ref(), &envelope_of(&used))?)
        }
        None => None,
    };
    let theory = reduced.configs(change);
    let config = surrogate.as_ref().map_or(theory.0, |s| s.config);
    let mut calibration = assemble(machine, config, fit.law, fit.region, used.len(), settings)?;
    calibration.oil = theory.1;
    if let Some(surrogate) = &surrogate {
        #[allow(clippy::cast_possible_truncation, reason = "the estimator works in f32")]
        let low = surrogate.low_pressure_mpa as f32;
        calibration.machine.low_pressure.0 = low;
    }
    let params = Params::new(&calibration)
        .map_err(|e| InputError::new(format!("the estimator refuses the identified calibration: {e}")))?;
    let points = results(&used, &rows, &solution, &fit, &params);
    let ratio_error_mean_pct = ratio_error_mean_pct(&points);
    Ok(Identification {
        calibration,
        points,
        refused,
        ratio_error_mean_pct,
        unknowns: unknowns(&fit, &solution),
        correlation: correlation(&solution),
        chi2_per_freedom: solution.chi2_per_freedom,
        change,
        surrogate,
        model_calls: calls,
        solution: Some(solution),
        fit,
    })
}

/// Normalisers, region and kept terms, from the points and their coefficients by the reduced model.
fn shape_of_law(reduced: &ReducedRatio, points: &[BenchPoint]) -> LawFit {
    let rough: Vec<[f64; 4]> = points
        .iter()
        .map(|p| [p.n_p_rpm, p.p_h_mpa, p.t_b_c, reduced.kou(&operating_point(p), p.ratio)])
        .collect();
    LawFit::new(&rough)
}

fn kept(fit: &LawFit) -> Vec<usize> {
    (0..TERMS.len()).filter(|i| TERMS.get(*i).is_some_and(|t| !fit.dropped.contains(t))).collect()
}

fn rows_of(fit: &LawFit, points: &[BenchPoint]) -> Vec<Row> {
    let kept = kept(fit);
    points
        .iter()
        .map(|p| {
            let x = normalised(&fit.law, p.n_p_rpm, p.p_h_mpa, p.t_b_c);
            let all = phi(x);
            Row { at: operating_point(p), ratio: p.ratio, x, phi: kept.iter().map(|i| all[*i]).collect() }
        })
        .collect()
}

struct Settled {
    solution: Solution,
    failed: Vec<(usize, SimError)>,
    calls: u32,
}

/// Rounds of fit and correction.
fn settle(
    rows: &[Row],
    reduced: &ReducedRatio,
    model: Option<&dyn RatioModel>,
    prior: &Prior,
) -> Result<Settled, InputError> {
    let mut correction = vec![0.0; rows.len()];
    let mut solution = joint::fit(rows, reduced, &correction, prior, None)?;
    let (mut failed, mut calls) = (Vec::new(), 0);
    let Some(model) = model else { return Ok(Settled { solution, failed, calls }) };
    for _ in 0..MOST_ROUNDS {
        let change = solution.change();
        let (better, here) = (model.changed(change)?, reduced.with_change(change)?);
        calls += u32::try_from(rows.len()).unwrap_or(u32::MAX);
        let solved: Vec<Result<f64, SimError>> = rows
            .par_iter()
            .map(|row| {
                let at = solution.at(row);
                let law: f64 = row.phi.iter().zip(&solution.unknowns).map(|(f, k)| f * k).sum();
                let kou = law.max(LEAST_KOU);
                better.solve(&at, kou).map(|s| s.ratio - here.ratio(&at, kou))
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
        if moved < SETTLED {
            break;
        }
    }
    Ok(Settled { solution, failed, calls })
}

/// Leakage coefficient that the measured ratio of a row shows on the machine as identified.
fn seen(row: &Row, i: usize, solution: &Solution) -> f64 {
    let law: f64 = row.phi.iter().zip(&solution.unknowns).map(|(f, k)| f * k).sum();
    law + (row.ratio - solution.ratio[i]) / solution.slope[i]
}

fn unexplained(rows: &[Row], solution: &Solution, used: &[BenchPoint]) -> Vec<(usize, Refusal)> {
    rows.iter()
        .enumerate()
        .filter(|(i, row)| seen(row, *i, solution) < 0.0)
        .map(|(i, row)| {
            let law: f64 = row.phi.iter().zip(&solution.unknowns).map(|(f, k)| f * k).sum();
            (i, Refusal::above_leak_free(used[i], solution.ratio[i] - solution.slope[i] * law))
        })
        .collect()
}

#[allow(clippy::cast_possible_truncation, reason = "the estimator works in f32")]
const fn single(value: f64) -> f32 {
    value as f32
}

/// The law with the solution's coefficients, their errors and the misfit.
fn with_solution(mut fit: LawFit, rows: &[Row], solution: &Solution) -> LawFit {
    let kept = kept(&fit);
    let mut all = [0.0_f32; 10];
    for (i, value) in kept.iter().zip(&solution.unknowns) {
        all[*i] = single(*value);
    }
    let law = &mut fit.law;
    [law.c, law.b1, law.b2, law.b3, law.a11, law.a22, law.a33, law.a12, law.a13, law.a23] = all;
    // Misfit: residuals in Kou, each counted by what its ratio's error lets it say.
    let (mut sum, mut weights) = (0.0, 0.0);
    for (i, row) in rows.iter().enumerate() {
        let weight = solution.weight[i] * (solution.slope[i] / solution.sigma[i]).powi(2);
        let misfit = (row.ratio - solution.ratio[i]) / solution.slope[i];
        sum += weight * misfit * misfit;
        weights += weight;
    }
    let freedom = rows.len().saturating_sub(kept.len()).max(1);
    let misfit = (sum / weights * rows.len() as f64 / freedom as f64).sqrt();
    law.residual_se.0 = single(misfit).min(10.0);
    law.covariance_factor = error_root(&solution.covariance_root, &kept, rows, &fit.region);
    fit.condition_number = solution.condition_number;
    fit
}

/// Rows of the root that the controller evaluates.
const ERROR_ROWS: usize = 4;
/// Steps of the grid over the region on which the rows are chosen and the rest is sought.
const REGION_STEPS: usize = 8;

/// The law's part of the covariance `A A^T`, by the directions that matter most over the region.
///
/// With `F` the terms at the points and all over the region, the right singular vectors `v` of `F A` are the independent errors in
/// the order of what they do to the law there. The first four make `R`, by a QR decomposition of `(A v)^T`; what the others do
/// together where they do most is the rest.
fn error_root(
    root: &DMatrix<f64>,
    kept: &[usize],
    rows: &[Row],
    region: &RegionConfig,
) -> LawCovarianceFactor {
    let mut all = DMatrix::zeros(10, root.ncols());
    for (row, term) in kept.iter().enumerate() {
        all.row_mut(*term).copy_from(&root.row(row));
    }
    // The grid misses the corners of the region, where the points are.
    let at_rows = rows.iter().map(|row| {
        let mut all = [0.0; 10];
        for (term, value) in kept.iter().zip(&row.phi) {
            all[*term] = *value;
        }
        all
    });
    let terms: Vec<f64> = points_of(region).into_iter().map(phi).chain(at_rows).flatten().collect();
    let at_points = DMatrix::from_row_slice(terms.len() / 10, 10, &terms) * &all;
    let eigen = nalgebra::SymmetricEigen::new(at_points.transpose() * &at_points);
    let (values, vectors) = (eigen.eigenvalues, eigen.eigenvectors);
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*b].total_cmp(&values[*a]));
    let (main, others) = order.split_at(ERROR_ROWS.min(order.len()));
    let rest2 = at_points
        .row_iter()
        .map(|row| others.iter().map(|i| (row * vectors.column(*i))[0].powi(2)).sum::<f64>())
        .fold(0.0, f64::max);
    // Ten rows, zeros below those that are wanted: the decomposition wants no fewer rows than columns.
    let mut transposed = DMatrix::zeros(10, 10);
    for (k, i) in main.iter().enumerate() {
        transposed.row_mut(k).copy_from(&(&all * vectors.column(*i)).transpose());
    }
    let r = transposed.qr().r();
    fn row<const N: usize>(r: &DMatrix<f64>) -> [f32; N] {
        let first = 10 - N;
        std::array::from_fn(|j| single(r[(first, first + j)]).clamp(-100.0, 100.0))
    }
    LawCovarianceFactor {
        first: row(&r),
        second: row(&r),
        third: row(&r),
        fourth: row(&r),
        remainder: LeakageCoefficient(single(rest2.sqrt()).min(10.0)),
    }
}

/// Normalised points of a grid over a region; over the box around it, where the region is too thin for the grid.
fn points_of(region: &RegionConfig) -> Vec<[f64; 3]> {
    let along = |bound: Bound| {
        let (min, max) = (f64::from(bound.min), f64::from(bound.max));
        (0..=REGION_STEPS).map(move |i| min + (max - min) * i as f64 / REGION_STEPS as f64)
    };
    let (inside, outside): (Vec<_>, Vec<_>) = along(region.speed)
        .flat_map(|x| along(region.pressure).map(move |y| (x, y)))
        .flat_map(|(x, y)| along(region.temperature).map(move |z| [x, y, z]))
        .partition(|point| region.outside(point.map(single)).is_none());
    if inside.is_empty() { outside } else { inside }
}

fn unknowns(fit: &LawFit, solution: &Solution) -> Vec<Unknown> {
    let mut names: Vec<String> =
        kept(fit).iter().filter_map(|i| TERMS.get(*i)).map(ToString::to_string).collect();
    names.extend(["displacement".to_string(), "bulk_modulus".to_string()]);
    names.extend(solution.settings.iter().map(|s| format!("alpha_{s:.2}")));
    names
        .into_iter()
        .enumerate()
        .map(|(i, name)| Unknown {
            name,
            value: solution.unknowns[i],
            se: solution.covariance_root.row(i).norm(),
            prior_se: Some(solution.prior_se[i]).filter(|p| p.is_finite()),
        })
        .collect()
}

fn correlation(solution: &Solution) -> Vec<Vec<f64>> {
    let root = solution.covariance_root.rows(0, solution.unknowns.len());
    let covariance = root * root.transpose();
    let se: Vec<f64> = (0..root.nrows()).map(|i| covariance[(i, i)].sqrt().max(f64::MIN_POSITIVE)).collect();
    (0..root.nrows())
        .map(|i| (0..root.nrows()).map(|j| covariance[(i, j)] / (se[i] * se[j])).collect())
        .collect()
}

/// The bench's own extent, with displacements from 0.3 or the smallest that was measured.
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

fn results(
    used: &[BenchPoint],
    rows: &[Row],
    solution: &Solution,
    fit: &LawFit,
    params: &Params,
) -> Vec<PointResult> {
    let low_mpa = f64::from(params.low_pressure().get());
    used.iter()
        .zip(rows)
        .enumerate()
        .map(|(i, (point, row))| {
            let kou_law: f64 = row.phi.iter().zip(&solution.unknowns).map(|(f, k)| f * k).sum();
            let root = solution.covariance_root.rows(0, row.phi.len());
            let of_coefficients = (nalgebra::RowDVector::from_row_slice(&row.phi) * root).norm();
            PointResult {
                point: *point,
                kou: seen(row, i, solution),
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
