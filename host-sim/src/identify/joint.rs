//! Joint identification: law, displacement ratio, bulk modulus and partial displacement settings from all points at once.
//!
//! Weighted least squares in the ratio domain with prior knowledge of what the points may not separate, by Gauss and
//! Newton with a singular value decomposition of every step's whitened Jacobian (never normal equations), and robust
//! weights against outliers. Derivatives are the reduced model's; where a better model is at hand its ratio is what is
//! fitted: it enters as a correction to the reduced model's ratio, made again at every new solution until it no longer
//! changes. What no quadratic can follow is an unknown function beside the law ([`super::discrepancy`]); its size is what makes
//! the points likeliest. `docs/identification.md` derives it and says what can be separated.
//!
//! Limits: unknowns are few (tens) and points some thousands; each displacement setting below full is one unknown.

use nalgebra::{DMatrix, DVector};

use super::discrepancy::{Basis, Discrepancy, Shape};
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
    /// What neither the law nor a smooth function beside it follows of a real machine's leakage, relative: keeps no point
    /// from being believed without limit.
    pub misfit: f64,
}

impl Default for Prior {
    fn default() -> Self {
        Self { displacement: 0.02, bulk: 0.1, setting: 0.05, ratio: 3e-4, pressure_mpa: 0.03, misfit: 0.003 }
    }
}

/// One measured point, with its row of the law's terms.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Where.
    pub at: At,
    /// Measured ratio.
    pub ratio: f64,
    /// Normalised speed, pressure and temperature.
    pub x: [f64; 3],
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
    /// Coefficients of the functions beside the law; see `discrepancy`.
    pub beside: Vec<f64>,
    /// What the quadratic misses, and its functions.
    pub discrepancy: Discrepancy,
    /// Its size and length, as chosen.
    pub shape: Shape,
    /// `L` with `L L^T` the covariance of the unknowns and, behind them, of `beside`.
    pub covariance_root: DMatrix<f64>,
    /// Prior standard error of each unknown; infinite for the law.
    pub prior_se: Vec<f64>,
    /// Condition number of the whitened Jacobian with columns scaled to one.
    pub condition_number: f64,
    /// Ratio by the law and the machine as identified, per row.
    pub ratio: Vec<f64>,
    /// The same from a fit without the row.
    pub ratio_without: Vec<f64>,
    /// `dr/dKou`, per row.
    pub slope: Vec<f64>,
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
/// Relative misfit in the first fit, which has no function beside the law: what a quadratic misses of a physical leakage.
const FIRST_MISFIT: f64 = 0.018;
/// Choices of the function's shape at most; they agree after one or two.
const CHOICES: usize = 3;
/// Weight below which a row has no say in that choice.
const GROSS: f64 = 0.2;

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

/// Fits; `correction` is what a better model's ratio is above the reduced model's, per row. An earlier solution for the same
/// rows is a start, and its shape is kept.
///
/// # Errors
/// A change of the machine that the estimator refuses.
pub fn fit(
    rows: &[Row],
    reduced: &ReducedRatio,
    correction: &[f64],
    prior: &Prior,
    start: Option<&Solution>,
) -> Result<Solution, InputError> {
    let settings = settings_of(rows);
    let kept = rows.first().map_or(0, |r| r.phi.len());
    let named = kept + 2 + settings.len();
    let problem = Problem { rows, reduced, correction, prior: *prior, settings: &settings, kept };
    let points: Vec<[f64; 3]> = rows.iter().map(|r| r.x).collect();
    let mut fitted = Fitted { unknowns: vec![0.0; named], weight: vec![1.0; rows.len()] };
    let mut shape = Shape { size: 0.0, length: 1.0 };
    let mut found;
    if let Some(start) = start {
        fitted.unknowns.clone_from(&start.unknowns);
        shape = start.shape;
        found = problem.converge(&mut fitted, &Basis::over(&points, shape.length), shape)?;
    } else {
        let first = Prior { misfit: prior.misfit.max(FIRST_MISFIT), ..*prior };
        found = Problem { prior: first, ..problem }.converge(&mut fitted, &Basis::over(&[], 1.0), shape)?;
        for _ in 0..CHOICES {
            let chosen = problem.likeliest(&fitted, &points)?;
            if chosen == shape {
                break;
            }
            shape = chosen;
            found = problem.converge(&mut fitted, &Basis::over(&points, shape.length), shape)?;
        }
    }
    let (linear, step) = found;
    let weight = fitted.weight;
    let squares: f64 = linear.residual.iter().zip(&weight).map(|(r, w)| w * r * r).sum();
    // What the fit can follow is not free: the trace of the leverages, the functions beside the law included.
    let freedom = (weight.iter().sum::<f64>() - step.leverage.iter().take(rows.len()).sum::<f64>()).max(1.0);
    let chi2_per_freedom = squares / freedom;
    // Errors larger than declared widen the covariance; smaller ones do not narrow it.
    let covariance_root = step.covariance_root * chi2_per_freedom.max(1.0).sqrt();
    let ratio_without = (0..rows.len())
        .map(|i| {
            let shift = step.shift_without.row(i);
            let derivative = |j: usize| linear.sigma[i] * linear.jacobian[(i, j)];
            let by_named: f64 = (0..named).map(|j| derivative(j) * shift[j]).sum();
            let beside: f64 =
                (named..shift.len()).map(|j| derivative(j) * (fitted.unknowns[j] - shift[j])).sum();
            linear.ratio[i] - by_named - linear.discrepancy.pull(i) * beside
        })
        .collect();
    let beside = fitted.unknowns.split_off(named);
    Ok(Solution {
        unknowns: fitted.unknowns,
        prior_se: problem.prior_se(named),
        settings,
        beside,
        discrepancy: linear.discrepancy,
        shape,
        covariance_root,
        condition_number: step.condition_number,
        ratio: linear.ratio,
        ratio_without,
        slope: linear.slope,
        weight,
        sigma: linear.sigma,
        chi2_per_freedom,
    })
}

#[derive(Clone, Copy)]
struct Problem<'a> {
    rows: &'a [Row],
    reduced: &'a ReducedRatio,
    correction: &'a [f64],
    prior: Prior,
    settings: &'a [f64],
    kept: usize,
}

/// Where a fit stands: the unknowns, those of the functions beside the law behind them, and the rows' weights.
struct Fitted {
    unknowns: Vec<f64>,
    weight: Vec<f64>,
}

/// The model about the present unknowns, whitened by each row's standard error.
struct Linear {
    jacobian: DMatrix<f64>,
    residual: DVector<f64>,
    /// By the law, without the functions beside it.
    ratio: Vec<f64>,
    slope: Vec<f64>,
    sigma: Vec<f64>,
    discrepancy: Discrepancy,
}

/// A stacked problem: weighted rows of the points, then one row for each unknown that is known beforehand. Columns are of
/// one length, since their units are no reason for a bad condition.
struct Stacked {
    whole: DMatrix<f64>,
    right: DVector<f64>,
    scale: Vec<f64>,
}

struct Step {
    delta: DVector<f64>,
    covariance_root: DMatrix<f64>,
    /// Of every stacked row.
    leverage: Vec<f64>,
    /// How far the unknowns are from a fit without the stacked row, a row for each.
    shift_without: DMatrix<f64>,
    condition_number: f64,
}

impl Problem<'_> {
    fn named(&self) -> usize {
        self.kept + 2 + self.settings.len()
    }

    /// Prior standard errors of the first `count` unknowns.
    fn prior_se(&self, count: usize) -> Vec<f64> {
        let mut all = vec![f64::INFINITY; self.kept];
        all.extend([self.prior.displacement, self.prior.bulk]);
        all.extend(self.settings.iter().map(|_| self.prior.setting));
        // The functions beside the law are made for coefficients of unit variance.
        all.resize(count.max(all.len()), 1.0);
        all
    }

    /// Iterates to the solution for one shape of the function beside the law.
    fn converge(
        &self,
        fitted: &mut Fitted,
        basis: &Basis,
        shape: Shape,
    ) -> Result<(Linear, Step), InputError> {
        let count = self.named() + basis.count();
        fitted.unknowns.truncate(self.named());
        fitted.unknowns.resize(count, 0.0);
        let prior_se = self.prior_se(count);
        let mut linear = self.linearise(&fitted.unknowns, basis, shape)?;
        let mut step = self.stack(&linear, fitted, &prior_se).solve();
        for iteration in 0..ITERATIONS {
            let before = fitted.unknowns.clone();
            for (value, delta) in fitted.unknowns.iter_mut().zip(step.delta.iter()) {
                *value += delta;
            }
            for (value, largest) in fitted.unknowns.iter_mut().skip(self.kept).zip(LARGEST_CHANGE) {
                *value = value.clamp(-largest, largest);
            }
            linear = self.linearise(&fitted.unknowns, basis, shape)?;
            // The first steps find the solution that all points share; only then can an outlier be told.
            if iteration >= 2 {
                fitted.weight = robust_weights(&linear, &step.leverage);
            }
            step = self.stack(&linear, fitted, &prior_se).solve();
            let named = fitted.unknowns.iter().zip(&before).take(self.named());
            let moved = named.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            // Coefficients and changes matter to 1e-4 at best; rounding of the f32 model ends progress near 1e-6.
            if iteration >= 4 && moved < 3e-6 {
                break;
            }
        }
        Ok((linear, step))
    }

    /// The shape under which the points are likeliest, everything else integrated over (marginal likelihood of the
    /// linearised problem; the flat prior of the law makes it the restricted one).
    fn likeliest(&self, fitted: &Fitted, points: &[[f64; 3]]) -> Result<Shape, InputError> {
        let mut at =
            Fitted { unknowns: fitted.unknowns[..self.named()].to_vec(), weight: fitted.weight.clone() };
        for weight in at.weight.iter_mut().filter(|w| **w >= GROSS) {
            *weight = 1.0;
        }
        let mut best = (f64::INFINITY, Shape { size: 0.0, length: 1.0 });
        let mut basis = Basis::over(&[], 1.0);
        let mut length = 0.0;
        for shape in Shape::all() {
            if shape.length != length {
                length = shape.length;
                basis = Basis::over(points, length);
            }
            let count = self.named() + basis.count();
            at.unknowns.resize(count, 0.0);
            let linear = self.linearise(&at.unknowns, &basis, shape)?;
            let stacked = self.stack(&linear, &at, &self.prior_se(count));
            let of_sigma: f64 = linear.sigma.iter().zip(&at.weight).map(|(s, w)| 2.0 * w * s.ln()).sum();
            let score = of_sigma + stacked.unlikelihood();
            if score < best.0 {
                best = (score, shape);
            }
        }
        Ok(best.1)
    }

    fn linearise(&self, unknowns: &[f64], basis: &Basis, shape: Shape) -> Result<Linear, InputError> {
        let (named, beside) = unknowns.split_at(self.named());
        let law = |row: &Row| -> f64 { row.phi.iter().zip(named).map(|(f, k)| f * k).sum() };
        let kou: Vec<f64> = self.rows.iter().map(law).collect();
        let terms: Vec<&[f64]> = self.rows.iter().map(|r| r.phi.as_slice()).collect();
        let points: Vec<[f64; 3]> = self.rows.iter().map(|r| r.x).collect();
        let discrepancy = Discrepancy::new(basis.clone(), shape.size, &points, &terms, &kou);
        let now = change(named, self.kept);
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
            discrepancy,
        };
        for (i, (row, correction)) in self.rows.iter().zip(self.correction).enumerate() {
            let at = settled(row, named, self.settings);
            let kou = kou[i];
            let slope = model.slope(&at) * at.alpha.signum();
            let ratio = model.ratio(&at, kou) + correction;
            let central =
                |pair: &[ReducedRatio; 2]| (pair[0].ratio(&at, kou) - pair[1].ratio(&at, kou)) / (2.0 * STEP);
            let per_mpa = {
                let higher = At { p_h_mpa: at.p_h_mpa * (1.0 + STEP), ..at };
                (model.ratio(&higher, kou) - model.ratio(&at, kou)) / (at.p_h_mpa * STEP)
            };
            let functions = linear.discrepancy.at(&row.x, &row.phi, kou);
            let sigma = (self.prior.ratio * row.ratio)
                .hypot(self.prior.pressure_mpa * per_mpa)
                .hypot(self.prior.misfit * kou.max(0.0) * slope)
                .hypot(functions.left * slope)
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
            let mut missed = 0.0;
            for (j, (f, coefficient)) in functions.kou.iter().zip(beside).enumerate() {
                linear.jacobian[(i, named.len() + j)] = slope * f / sigma;
                missed += slope * f * coefficient;
            }
            linear.residual[i] = (row.ratio - ratio - missed) / sigma;
            linear.ratio.push(ratio);
            linear.slope.push(slope);
            linear.sigma.push(sigma);
        }
        Ok(linear)
    }

    fn stack(&self, linear: &Linear, fitted: &Fitted, prior_se: &[f64]) -> Stacked {
        let (n, count) = linear.jacobian.shape();
        let known: Vec<usize> = (0..count).filter(|j| prior_se[*j].is_finite()).collect();
        let mut whole = DMatrix::zeros(n + known.len(), count);
        let mut right = DVector::zeros(n + known.len());
        for i in 0..n {
            let root = fitted.weight[i].sqrt();
            for j in 0..count {
                whole[(i, j)] = root * linear.jacobian[(i, j)];
            }
            right[i] = root * linear.residual[i];
        }
        for (k, j) in known.iter().enumerate() {
            whole[(n + k, *j)] = 1.0 / prior_se[*j];
            right[n + k] = -fitted.unknowns[*j] / prior_se[*j];
        }
        let scale: Vec<f64> = whole.column_iter().map(|c| c.norm().max(f64::MIN_POSITIVE)).collect();
        for (j, s) in scale.iter().enumerate() {
            whole.column_mut(j).unscale_mut(*s);
        }
        Stacked { whole, right, scale }
    }
}

impl Stacked {
    /// One Gauss-Newton step.
    fn solve(self) -> Step {
        let Self { whole, right, scale } = self;
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
        let delta = &root * (u.transpose() * &right);
        let leverage: Vec<f64> = (0..u.nrows()).map(|i| u.row(i).norm_squared().min(1.0)).collect();
        let mut shift_without = u * root.transpose();
        for (i, h) in leverage.iter().enumerate() {
            shift_without.row_mut(i).scale_mut(right[i] / (1.0 - h).max(1e-3));
        }
        Step {
            delta,
            covariance_root: root,
            leverage,
            shift_without,
            condition_number: largest / svd.singular_values.min().max(f64::MIN_POSITIVE),
        }
    }

    /// Twice the negative logarithm of the problem's marginal likelihood, but for a constant and the rows' own errors: the
    /// logarithm of the determinant of its normal matrix, and the squares that no choice of the unknowns removes.
    fn unlikelihood(self) -> f64 {
        let (rows, columns) = self.whole.shape();
        if rows < columns {
            return f64::INFINITY;
        }
        let qr = self.whole.qr();
        let mut right = self.right;
        qr.q_tr_mul(&mut right);
        let determinant: f64 =
            qr.r().diagonal().iter().zip(&self.scale).map(|(r, s)| (r.abs() * s).ln()).sum();
        2.0 * determinant + right.rows(columns, rows - columns).norm_squared()
    }
}

/// Weights of the residuals, each made comparable by its leverage, on the scale of their median.
fn robust_weights(linear: &Linear, leverage: &[f64]) -> Vec<f64> {
    let standard: Vec<f64> =
        linear.residual.iter().zip(leverage).map(|(r, h)| r.abs() / (1.0 - h).max(1e-3).sqrt()).collect();
    let mut sorted = standard.clone();
    sorted.sort_by(f64::total_cmp);
    let median = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
    // 1.4826: the standard deviation of a normal distribution over its median magnitude. Residuals within their declared
    // errors are no outliers whatever their neighbours are.
    let scale = (1.4826 * median).max(1.0);
    let weight = |r: f64| {
        let huber = (HUBER * scale / r.max(1e-12)).min(1.0);
        huber * ((VANISH - r / scale) / (VANISH - DESCEND)).clamp(0.0, 1.0)
    };
    standard.into_iter().map(weight).collect()
}

/// How the ratio at hypothetical points would depend on the unknowns and on what stands beside the law, each row divided by
/// its standard error. `unknowns` and `settings` may have more settings than the solution.
///
/// # Errors
/// A change of the machine that the estimator refuses.
pub fn sensitivities(
    rows: &[Row],
    settings: &[f64],
    reduced: &ReducedRatio,
    solution: &Solution,
    unknowns: &[f64],
    prior: &Prior,
) -> Result<DMatrix<f64>, InputError> {
    let kept = unknowns.len() - 2 - settings.len();
    let correction = vec![0.0; rows.len()];
    let problem = Problem { rows, reduced, correction: &correction, prior: *prior, settings, kept };
    let linear = problem.linearise(unknowns, &Basis::over(&[], 1.0), Shape { size: 0.0, length: 1.0 })?;
    let (named, beside) = (unknowns.len(), solution.beside.len());
    let mut jacobian = linear.jacobian.resize_horizontally(named + beside, 0.0);
    for (i, row) in rows.iter().enumerate() {
        let kou: f64 = row.phi.iter().zip(unknowns).map(|(f, k)| f * k).sum();
        for (j, f) in solution.discrepancy.at(&row.x, &row.phi, kou).kou.iter().enumerate() {
            jacobian[(i, named + j)] = linear.slope[i] * f / linear.sigma[i];
        }
    }
    Ok(jacobian)
}
