//! Experiment design: proposals of further bench points, ranked by the reduction of the law's standard error per point.
//!
//! In a linear Gaussian model the posterior covariance after further points does not depend on their outcome (Bayesian
//! experiment design: Chaloner and Verdinelli 1995). The criterion is the mean relative standard error of Kou over the
//! measured points. Proposals are blocks as run on a bench: one point at full displacement, or one partial displacement at two
//! speeds and three pressures, because the first points at a new displacement setting only determine its actual value.

use nalgebra::{DMatrix, DVector};

use kou_lumped::OperatingPoint;
use kou_records::InputError;

use crate::joint::{self, JointSolution, Observation, Prior};
use crate::law_fit::LawFit;
use crate::reduced_plant::ReducedPlant;

/// Proposed block of bench points.
#[derive(Debug, Clone, PartialEq)]
pub struct Proposal {
    /// Points: r/min, MPa, degC, displacement fraction.
    pub points: Vec<[f64; 4]>,
    /// Present mean relative standard error of Kou over the measured points, in per cent.
    pub kou_se_now_pct: f64,
    /// Mean relative standard error of Kou after this block, in per cent.
    pub kou_se_then_pct: f64,
    /// Standard error of the bulk modulus after this block, in per cent.
    pub bulk_se_then_pct: f64,
}

/// Number of proposals.
const PROPOSALS: usize = 5;

/// Proposes blocks of points, in ascending order of the standard error that they lead to.
///
/// # Errors
/// A machine rejected by the estimator.
#[doc(alias = "optimal design")]
pub fn propose(
    measured: &[OperatingPoint],
    fit: &LawFit,
    reduced: &ReducedPlant,
    solution: &JointSolution,
    prior: &Prior,
) -> Result<Vec<Proposal>, InputError> {
    let law_terms = fit.determined_terms().len();
    let identified = reduced.with_correction(solution.correction())?;
    let predict = |[n, p, t, alpha]: [f64; 4]| {
        let at = OperatingPoint { n_p_rpm: n, p_h_mpa: p, p_l_mpa: None, t_b_c: t, alpha };
        let mut point = Observation::new(fit, at, 0.0);
        // The expected measurement, to which its error is relative.
        point.ratio = identified.ratio(&at, point.kou(&solution.unknowns));
        point
    };
    let present: Vec<Observation> =
        measured.iter().map(|a| predict([a.n_p_rpm, a.p_h_mpa, a.t_b_c, a.alpha])).collect();
    let levels = |of: fn(&OperatingPoint) -> f64| {
        let low = measured.iter().map(of).fold(f64::INFINITY, f64::min);
        let high = measured.iter().map(of).fold(f64::NEG_INFINITY, f64::max);
        [low, 0.5 * (low + high), high]
    };
    let (speeds, pressures, temperatures) =
        (levels(|a| a.n_p_rpm), levels(|a| a.p_h_mpa), levels(|a| a.t_b_c));
    let mut blocks: Vec<Vec<[f64; 4]>> = Vec::new();
    for t in temperatures {
        for alpha in [0.3, 0.45, 0.6, 0.8] {
            let extremes = [speeds[0], speeds[2]];
            blocks.push(extremes.iter().flat_map(|n| pressures.map(|p| [*n, p, t, alpha])).collect());
        }
        for n in speeds {
            blocks.extend(pressures.map(|p| vec![[n, p, t, 1.0]]));
        }
    }
    let kou_se_now_pct = mean_se_pct(
        &present,
        &solution.unknowns,
        &(&solution.covariance_factor * solution.covariance_factor.transpose()),
    );
    let mut proposals = Vec::new();
    for block in blocks {
        let rows: Vec<Observation> = block.iter().map(|p| predict(*p)).collect();
        let covariance = posterior_covariance(&rows, reduced, solution, prior)?;
        let bulk = law_terms + 1;
        proposals.push(Proposal {
            points: block,
            kou_se_now_pct,
            kou_se_then_pct: mean_se_pct(&present, &solution.unknowns, &covariance),
            bulk_se_then_pct: 100.0 * covariance[(bulk, bulk)].max(0.0).sqrt(),
        });
    }
    // Information gain per point: the logarithm of the standard error is additive over points.
    let gain = |p: &Proposal| (p.kou_se_then_pct / p.kou_se_now_pct).ln() / p.points.len() as f64;
    proposals.sort_by(|a, b| gain(a).total_cmp(&gain(b)));
    // Single points and blocks of a displacement setting determine different parameters: both kinds are proposed.
    let (single, block): (Vec<_>, Vec<_>) = proposals.into_iter().partition(|p| p.points.len() == 1);
    let mut best: Vec<Proposal> =
        block.into_iter().take(2).chain(single.into_iter().take(PROPOSALS - 2)).collect();
    best.sort_by(|a, b| a.kou_se_then_pct.total_cmp(&b.kou_se_then_pct));
    Ok(best)
}

/// Covariance of the unknowns after measuring `rows`, by the covariance update of the Kalman filter.
#[doc(alias = "Kalman")]
fn posterior_covariance(
    rows: &[Observation],
    reduced: &ReducedPlant,
    solution: &JointSolution,
    prior: &Prior,
) -> Result<DMatrix<f64>, InputError> {
    let mut settings = solution.settings.clone();
    let mut unknowns = solution.unknowns.clone();
    let alpha = rows.first().map_or(1.0, |r| r.at.alpha);
    if alpha < 0.99 && !settings.iter().any(|s| (s - alpha).abs() < 0.01) {
        settings.push(alpha);
        unknowns.push(0.0);
    }
    // A new setting is inserted between the unknowns of the solution and the discrepancy coefficients.
    let (known, added) = (solution.unknowns.len(), unknowns.len() - solution.unknowns.len());
    let total = unknowns.len() + solution.discrepancy_coefficients.len();
    let index = |i: usize| if i < known { i } else { i + added };
    let before = &solution.covariance_factor * solution.covariance_factor.transpose();
    let mut covariance = DMatrix::zeros(total, total);
    for i in 0..before.nrows() {
        for j in 0..before.ncols() {
            covariance[(index(i), index(j))] = before[(i, j)];
        }
    }
    for i in known..unknowns.len() {
        covariance[(i, i)] = prior.setting.powi(2);
    }
    let j = joint::sensitivities(rows, &settings, reduced, solution, &unknowns, prior)?;
    let gain = &covariance * j.transpose();
    let innovation = &j * &gain + DMatrix::identity(rows.len(), rows.len());
    let Some(factor) = innovation.cholesky() else { return Ok(covariance) };
    let reduction = &gain * factor.solve(&gain.transpose());
    Ok(covariance - reduction)
}

/// Mean relative standard error of Kou over points, in per cent.
fn mean_se_pct(rows: &[Observation], unknowns: &[f64], covariance: &DMatrix<f64>) -> f64 {
    let sum: f64 = rows
        .iter()
        .map(|row| {
            let f = DVector::from_row_slice(&row.phi);
            let kou = row.kou(unknowns);
            let law = covariance.view((0, 0), (f.len(), f.len()));
            (f.transpose() * law * &f)[(0, 0)].max(0.0).sqrt() / kou.abs().max(1e-6)
        })
        .sum();
    100.0 * sum / rows.len() as f64
}
