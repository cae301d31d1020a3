//! Joint identification: law, displacement ratio, bulk modulus and partial displacement settings from all points at once.
//!
//! Weighted least squares in the ratio domain with prior knowledge of what the points may not separate, by Gauss and
//! Newton with a singular value decomposition of every step's whitened Jacobian (never normal equations), and robust
//! weights against outliers. Derivatives are the reduced model's; where a better model is at hand its ratio is what is
//! fitted: it enters as a correction to the reduced model's ratio, made again at every new solution until it no longer
//! changes. `docs/identification.md` derives it and says what can be separated.
//!
//! Limits: unknowns are few (tens) and points some thousands; each displacement setting below full is one unknown.

use nalgebra::{DMatrix, DVector};

use super::ratio_model::{At, Change, ReducedRatio};
use crate::input::InputError;

/// What is known beforehand, all standard errors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prior {
    /// Relative, of the displacement ratio: tolerance of the machine file and systematic error of both speed sensors.
    pub displacement: f64,
    /// Relative, of the bulk modulus in the machine file.
    pub bulk: f64,
    /// Relative, of each displacement setting below full.
    pub setting: f64,
    /// Random error of a measured ratio, relative.
    pub ratio: f64,
    /// Random error of a measured pressure.
    pub pressure_mpa: f64,
    /// What a quadratic misses of a real machine's leakage, relative: keeps no point from being believed without limit.
    pub misfit: f64,
}

impl Default for Prior {
    fn default() -> Self {
        Self { displacement: 0.02, bulk: 0.1, setting: 0.05, ratio: 3e-4, pressure_mpa: 0.03, misfit: 0.018 }
    }
}

/// One measured point, with its row of the law's terms.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Where.
    pub at: At,
    /// Measured ratio.
    pub ratio: f64,
    /// The law's kept terms here.
    pub phi: Vec<f64>,
}

/// The solution.
#[derive(Debug, Clone)]
pub struct Solution {
    /// Coefficients of the kept terms, then displacement and bulk modulus (relative change), then the settings.
    pub unknowns: Vec<f64>,
    /// Nominal settings below full displacement, in the order of their unknowns.
    pub settings: Vec<f64>,
    /// `L` with `L L^T` the covariance of the unknowns.
    pub covariance_root: DMatrix<f64>,
    /// Prior standard error of each unknown; infinite for the law.
    pub prior_se: Vec<f64>,
    /// Condition number of the whitened Jacobian with columns scaled to one.
    pub condition_number: f64,
    /// Ratio by the solution, per row.
    pub ratio: Vec<f64>,
    /// `dr/dKou`, per row.
    pub slope: Vec<f64>,
    /// Leverage of each row.
    pub leverage: Vec<f64>,
    /// Robust weight of each row, 1 for a row that is believed.
    pub weight: Vec<f64>,
    /// Standard error given to each row's ratio.
    pub sigma: Vec<f64>,
    /// Sum of squared whitened residuals per degree of freedom.
    pub chi2_per_freedom: f64,
}

/// Index of the displacement among the unknowns behind `kept` law terms; bulk modulus and settings follow.
const fn displacement_index(kept: usize) -> usize {
    kept
}

/// Settings closer than this are one setting of one stop or lever.
const SAME_SETTING: f64 = 0.01;
/// Largest relative change of displacement and bulk modulus that an identification may claim.
const LARGEST_CHANGE: [f64; 2] = [0.15, 0.45];
/// Steps of the differences by which the reduced model is differentiated. It works in f32, 6e-8 of ratio, and is nearly
/// linear in all three, so wide steps cost nothing and keep rounding below 1e-5 of the derivative.
const STEP: f64 = 0.01;
/// Huber's constant: 95 % efficiency for normal errors.
const HUBER: f64 = 1.345;
/// Residuals, in standard deviations, between which a weight falls on to nothing: a gross error has no say at all (Hampel
/// 1974, three-part function).
const DESCEND: f64 = 4.0;
const VANISH: f64 = 8.0;
const ITERATIONS: usize = 25;

impl Solution {
    /// The machine's change.
    #[must_use]
    pub fn change(&self) -> Change {
        change(&self.unknowns, self.unknowns.len() - 2 - self.settings.len())
    }

    /// The row's point with its displacement as identified.
    #[must_use]
    pub fn at(&self, row: &Row) -> At {
        settled(row, &self.unknowns, &self.settings)
    }
}

fn change(unknowns: &[f64], kept: usize) -> Change {
    let d = displacement_index(kept);
    Change { displacement: 1.0 + unknowns[d], bulk: 1.0 + unknowns[d + 1] }
}

fn setting_of(row: &Row, settings: &[f64]) -> Option<usize> {
    settings.iter().position(|s| (row.at.alpha.abs() - s).abs() < SAME_SETTING)
}

fn settled(row: &Row, unknowns: &[f64], settings: &[f64]) -> At {
    let first = unknowns.len() - settings.len();
    let factor = setting_of(row, settings).map_or(1.0, |i| 1.0 + unknowns[first + i]);
    At { alpha: row.at.alpha * factor, ..row.at }
}

/// Partial displacement settings among the rows, ascending.
fn settings_of(rows: &[Row]) -> Vec<f64> {
    let mut all: Vec<f64> =
        rows.iter().map(|r| r.at.alpha.abs()).filter(|a| *a < 1.0 - SAME_SETTING).collect();
    all.sort_by(f64::total_cmp);
    all.dedup_by(|a, b| (*a - *b).abs() < SAME_SETTING);
    all
}

/// Fits; `correction` is what a better model's ratio is above the reduced model's, per row.
///
/// # Errors
/// A change of the machine that the estimator refuses.
pub fn fit(
    rows: &[Row],
    reduced: &ReducedRatio,
    correction: &[f64],
    prior: &Prior,
    start: Option<&[f64]>,
) -> Result<Solution, InputError> {
    let settings = settings_of(rows);
    let kept = rows.first().map_or(0, |r| r.phi.len());
    let count = kept + 2 + settings.len();
    let mut prior_se = vec![f64::INFINITY; kept];
    prior_se.extend([prior.displacement, prior.bulk]);
    prior_se.extend(settings.iter().map(|_| prior.setting));
    let problem = Problem { rows, reduced, correction, prior, settings: &settings, kept };
    let mut unknowns = start.map_or_else(|| vec![0.0; count], <[f64]>::to_vec);
    let mut weight = vec![1.0; rows.len()];
    let mut linear = problem.linearise(&unknowns)?;
    let mut step = problem.solve(&linear, &unknowns, &weight, &prior_se);
    for iteration in 0..ITERATIONS {
        let before = unknowns.clone();
        for (value, delta) in unknowns.iter_mut().zip(step.delta.iter()) {
            *value += delta;
        }
        for (value, largest) in unknowns.iter_mut().skip(kept).zip(LARGEST_CHANGE) {
            *value = value.clamp(-largest, largest);
        }
        linear = problem.linearise(&unknowns)?;
        // The first steps find the solution that all points share; only then can an outlier be told.
        if iteration >= 2 {
            weight = robust_weights(&linear, &step.leverage);
        }
        step = problem.solve(&linear, &unknowns, &weight, &prior_se);
        let moved = unknowns.iter().zip(&before).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        // Coefficients and changes matter to 1e-4 at best; rounding of the f32 model ends progress near 1e-6.
        if iteration >= 4 && moved < 3e-6 {
            break;
        }
    }
    let squares: f64 = linear.residual.iter().zip(&weight).map(|(r, w)| w * r * r).sum();
    let freedom = rows.len().saturating_sub(kept + 2 + settings.len()).max(1);
    let chi2_per_freedom = squares / freedom as f64;
    // Errors larger than declared widen the covariance; smaller ones do not narrow it.
    let covariance_root = step.covariance_root * chi2_per_freedom.max(1.0).sqrt();
    Ok(Solution {
        unknowns,
        settings,
        covariance_root,
        prior_se,
        condition_number: step.condition_number,
        ratio: linear.ratio,
        slope: linear.slope,
        leverage: step.leverage,
        weight,
        sigma: linear.sigma,
        chi2_per_freedom,
    })
}

struct Problem<'a> {
    rows: &'a [Row],
    reduced: &'a ReducedRatio,
    correction: &'a [f64],
    prior: &'a Prior,
    settings: &'a [f64],
    kept: usize,
}

/// The model about the present unknowns, whitened by each row's standard error.
struct Linear {
    jacobian: DMatrix<f64>,
    residual: DVector<f64>,
    ratio: Vec<f64>,
    slope: Vec<f64>,
    sigma: Vec<f64>,
}

struct Step {
    delta: DVector<f64>,
    covariance_root: DMatrix<f64>,
    leverage: Vec<f64>,
    condition_number: f64,
}

impl Problem<'_> {
    fn linearise(&self, unknowns: &[f64]) -> Result<Linear, InputError> {
        let now = change(unknowns, self.kept);
        let model = self.reduced.with_change(now)?;
        let with = |change: Change| self.reduced.with_change(change);
        let displaced = [
            with(Change { displacement: now.displacement + STEP, ..now })?,
            with(Change { displacement: now.displacement - STEP, ..now })?,
        ];
        let softened =
            [with(Change { bulk: now.bulk + STEP, ..now })?, with(Change { bulk: now.bulk - STEP, ..now })?];
        let (n, count) = (self.rows.len(), unknowns.len());
        let mut linear = Linear {
            jacobian: DMatrix::zeros(n, count),
            residual: DVector::zeros(n),
            ratio: Vec::with_capacity(n),
            slope: Vec::with_capacity(n),
            sigma: Vec::with_capacity(n),
        };
        for (i, (row, correction)) in self.rows.iter().zip(self.correction).enumerate() {
            let at = settled(row, unknowns, self.settings);
            let kou: f64 = row.phi.iter().zip(unknowns).map(|(f, k)| f * k).sum();
            let slope = model.slope(&at) * at.alpha.signum();
            let ratio = model.ratio(&at, kou) + correction;
            let central =
                |pair: &[ReducedRatio; 2]| (pair[0].ratio(&at, kou) - pair[1].ratio(&at, kou)) / (2.0 * STEP);
            let per_mpa = {
                let higher = At { p_h_mpa: at.p_h_mpa * (1.0 + STEP), ..at };
                (model.ratio(&higher, kou) - model.ratio(&at, kou)) / (at.p_h_mpa * STEP)
            };
            let sigma = (self.prior.ratio * row.ratio)
                .hypot(self.prior.pressure_mpa * per_mpa)
                .hypot(self.prior.misfit * kou.max(0.0) * slope)
                .max(1e-6);
            for (j, f) in row.phi.iter().enumerate() {
                linear.jacobian[(i, j)] = slope * f / sigma;
            }
            let d = displacement_index(self.kept);
            linear.jacobian[(i, d)] = central(&displaced) / sigma;
            linear.jacobian[(i, d + 1)] = central(&softened) / sigma;
            if let Some(setting) = setting_of(row, self.settings) {
                let wider = At { alpha: at.alpha + row.at.alpha * STEP, ..at };
                let narrower = At { alpha: at.alpha - row.at.alpha * STEP, ..at };
                let per = (model.ratio(&wider, kou) - model.ratio(&narrower, kou)) / (2.0 * STEP);
                linear.jacobian[(i, d + 2 + setting)] = per / sigma;
            }
            linear.residual[i] = (row.ratio - ratio) / sigma;
            linear.ratio.push(ratio);
            linear.slope.push(slope);
            linear.sigma.push(sigma);
        }
        Ok(linear)
    }

    /// One Gauss-Newton step: rows of the points, then one row for each unknown that is known beforehand.
    fn solve(&self, linear: &Linear, unknowns: &[f64], weight: &[f64], prior_se: &[f64]) -> Step {
        let (n, count) = linear.jacobian.shape();
        let known: Vec<usize> = (0..count).filter(|j| prior_se[*j].is_finite()).collect();
        let mut whole = DMatrix::zeros(n + known.len(), count);
        let mut right = DVector::zeros(n + known.len());
        for i in 0..n {
            let root = weight[i].sqrt();
            for j in 0..count {
                whole[(i, j)] = root * linear.jacobian[(i, j)];
            }
            right[i] = root * linear.residual[i];
        }
        for (k, j) in known.iter().enumerate() {
            whole[(n + k, *j)] = 1.0 / prior_se[*j];
            right[n + k] = -unknowns[*j] / prior_se[*j];
        }
        // Columns of one length: their units are no reason for a bad condition.
        let scale: Vec<f64> = whole.column_iter().map(|c| c.norm().max(f64::MIN_POSITIVE)).collect();
        for (j, s) in scale.iter().enumerate() {
            whole.column_mut(j).unscale_mut(*s);
        }
        let svd = whole.svd(true, true);
        let (Some(u), Some(v_t)) = (&svd.u, &svd.v_t) else { unreachable!("both were asked for") };
        let largest = svd.singular_values.max();
        let inverse: Vec<f64> =
            svd.singular_values.iter().map(|s| if *s > 1e-12 * largest { 1.0 / s } else { 0.0 }).collect();
        let mut root = v_t.transpose();
        for (k, inverse) in inverse.iter().enumerate() {
            root.column_mut(k).scale_mut(*inverse);
        }
        for (j, s) in scale.iter().enumerate() {
            root.row_mut(j).unscale_mut(*s);
        }
        let delta = &root * (u.transpose() * right);
        let leverage = (0..n).map(|i| u.row(i).norm_squared().min(1.0)).collect();
        Step {
            delta,
            covariance_root: root,
            leverage,
            condition_number: largest / svd.singular_values.min().max(f64::MIN_POSITIVE),
        }
    }
}

/// Weights of the residuals, each made comparable by its leverage, on the scale of their median.
fn robust_weights(linear: &Linear, leverage: &[f64]) -> Vec<f64> {
    let standard: Vec<f64> =
        linear.residual.iter().zip(leverage).map(|(r, h)| r.abs() / (1.0 - h).max(1e-3).sqrt()).collect();
    let mut sorted = standard.clone();
    sorted.sort_by(f64::total_cmp);
    let median = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
    // 1.4826: the standard deviation of a normal distribution over its median magnitude. Residuals far below their
    // declared errors are no outliers whatever their neighbours are.
    let scale = (1.4826 * median).max(0.3);
    let weight = |r: f64| {
        let huber = (HUBER * scale / r.max(1e-12)).min(1.0);
        huber * ((VANISH - r / scale) / (VANISH - DESCEND)).clamp(0.0, 1.0)
    };
    standard.into_iter().map(weight).collect()
}

/// How the ratio at hypothetical points would depend on the unknowns, each row divided by its standard error.
///
/// # Errors
/// A change of the machine that the estimator refuses.
pub fn sensitivities(
    rows: &[Row],
    settings: &[f64],
    reduced: &ReducedRatio,
    unknowns: &[f64],
    prior: &Prior,
) -> Result<DMatrix<f64>, InputError> {
    let kept = unknowns.len() - 2 - settings.len();
    let correction = vec![0.0; rows.len()];
    let problem = Problem { rows, reduced, correction: &correction, prior, settings, kept };
    Ok(problem.linearise(unknowns)?.jacobian)
}
