//! Which points to measure next: those that shrink the law's uncertainty most, per point.
//!
//! From the covariance of a joint identification follows what it would be after further points, whatever they show
//! (Bayesian D-optimal design, judged by the mean standard error of Kou over the measured points, which is what the user
//! reads). Proposals are blocks as a bench runs them: one full-displacement point, or one displacement setting at two
//! speeds and three pressures, since the first points at a new setting only pay for its unknown exact displacement.

use nalgebra::{DMatrix, DVector};

use super::joint::{self, Prior, Row, Solution};
use super::law_fit::{LawFit, TERMS, normalised, phi};
use super::ratio_model::{OperatingPoint, ReducedRatio};
use kou_records::InputError;

/// One proposal.
#[derive(Debug, Clone, PartialEq)]
pub struct Proposal {
    /// The points: r/min, MPa, degC, displacement.
    pub points: Vec<[f64; 4]>,
    /// Mean relative standard error of Kou over the measured points as it is, in per cent.
    pub kou_se_now_pct: f64,
    /// The same after this block.
    pub kou_se_then_pct: f64,
    /// Standard error of the bulk modulus after this block, in per cent.
    pub bulk_se_then_pct: f64,
}

/// Proposals that are made.
const PROPOSALS: usize = 5;

/// Proposes blocks of points, the best per point first.
///
/// # Errors
/// A machine that the estimator refuses.
pub fn advise(
    measured: &[OperatingPoint],
    fit: &LawFit,
    reduced: &ReducedRatio,
    solution: &Solution,
    prior: &Prior,
) -> Result<Vec<Proposal>, InputError> {
    let kept: Vec<usize> =
        (0..TERMS.len()).filter(|i| TERMS.get(*i).is_some_and(|t| !fit.dropped.contains(t))).collect();
    let changed = reduced.with_change(solution.change())?;
    let row = |[n, p, t, alpha]: [f64; 4]| {
        let x = normalised(&fit.law, n, p, t);
        let all = phi(x);
        let at = OperatingPoint { n_p_rpm: n, p_h_mpa: p, p_l_mpa: None, t_b_c: t, alpha };
        let terms: Vec<f64> = kept.iter().map(|i| all[*i]).collect();
        let kou: f64 = terms.iter().zip(&solution.unknowns).map(|(f, k)| f * k).sum();
        // What would be measured: its error is relative to it.
        Row { at, ratio: changed.ratio(&at, kou), x, phi: terms }
    };
    let here: Vec<Row> = measured.iter().map(|a| row([a.n_p_rpm, a.p_h_mpa, a.t_b_c, a.alpha])).collect();
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
            let both = [speeds[0], speeds[2]];
            blocks.push(both.iter().flat_map(|n| pressures.map(|p| [*n, p, t, alpha])).collect());
        }
        for n in speeds {
            blocks.extend(pressures.map(|p| vec![[n, p, t, 1.0]]));
        }
    }
    let kou_se_now_pct = mean_se_pct(
        &here,
        &solution.unknowns,
        &(&solution.covariance_root * solution.covariance_root.transpose()),
    );
    let mut proposals = Vec::new();
    for block in blocks {
        let rows: Vec<Row> = block.iter().map(|p| row(*p)).collect();
        let covariance = after(&rows, reduced, solution, prior)?;
        let bulk = kept.len() + 1;
        proposals.push(Proposal {
            points: block,
            kou_se_now_pct,
            kou_se_then_pct: mean_se_pct(&here, &solution.unknowns, &covariance),
            bulk_se_then_pct: 100.0 * covariance[(bulk, bulk)].max(0.0).sqrt(),
        });
    }
    // Gain in information per point: the logarithm of the uncertainty adds up over points.
    let gain = |p: &Proposal| (p.kou_se_then_pct / p.kou_se_now_pct).ln() / p.points.len() as f64;
    proposals.sort_by(|a, b| gain(a).total_cmp(&gain(b)));
    // The best single point and the best block of a new setting answer different questions: neither may crowd out the other.
    let (single, block): (Vec<_>, Vec<_>) = proposals.into_iter().partition(|p| p.points.len() == 1);
    let mut best: Vec<Proposal> =
        block.into_iter().take(2).chain(single.into_iter().take(PROPOSALS - 2)).collect();
    best.sort_by(|a, b| a.kou_se_then_pct.total_cmp(&b.kou_se_then_pct));
    Ok(best)
}

/// Covariance of the unknowns after measuring `rows`, by the update of a Kalman filter.
fn after(
    rows: &[Row],
    reduced: &ReducedRatio,
    solution: &Solution,
    prior: &Prior,
) -> Result<DMatrix<f64>, InputError> {
    let mut settings = solution.settings.clone();
    let mut unknowns = solution.unknowns.clone();
    let alpha = rows.first().map_or(1.0, |r| r.at.alpha);
    if alpha < 0.99 && !settings.iter().any(|s| (s - alpha).abs() < 0.01) {
        settings.push(alpha);
        unknowns.push(0.0);
    }
    // A new setting stands between the unknowns so far and the functions beside the law.
    let (known, added) = (solution.unknowns.len(), unknowns.len() - solution.unknowns.len());
    let total = unknowns.len() + solution.beside.len();
    let place = |i: usize| if i < known { i } else { i + added };
    let before = &solution.covariance_root * solution.covariance_root.transpose();
    let mut covariance = DMatrix::zeros(total, total);
    for i in 0..before.nrows() {
        for j in 0..before.ncols() {
            covariance[(place(i), place(j))] = before[(i, j)];
        }
    }
    for i in known..unknowns.len() {
        covariance[(i, i)] = prior.setting.powi(2);
    }
    let j = joint::sensitivities(rows, &settings, reduced, solution, &unknowns, prior)?;
    let gain = &covariance * j.transpose();
    let innovation = &j * &gain + DMatrix::identity(rows.len(), rows.len());
    let Some(factor) = innovation.cholesky() else { return Ok(covariance) };
    let change = &gain * factor.solve(&gain.transpose());
    Ok(covariance - change)
}

fn mean_se_pct(rows: &[Row], unknowns: &[f64], covariance: &DMatrix<f64>) -> f64 {
    let sum: f64 = rows
        .iter()
        .map(|row| {
            let f = DVector::from_row_slice(&row.phi);
            let kou: f64 = row.phi.iter().zip(unknowns).map(|(f, k)| f * k).sum();
            let law = covariance.view((0, 0), (f.len(), f.len()));
            (f.transpose() * law * &f)[(0, 0)].max(0.0).sqrt() / kou.abs().max(1e-6)
        })
        .sum();
    100.0 * sum / rows.len() as f64
}
