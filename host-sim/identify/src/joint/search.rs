//! The way to the solution: iterations with robust weights, and which function beside the law makes the points likeliest.

use super::linear::{Linear, Problem};
use super::stacked::{Stacked, Step};
use crate::discrepancy::{Basis, Shape};
use kou_records::InputError;

/// Largest relative change of displacement and bulk modulus that an identification may claim.
const LARGEST_CHANGE: [f64; 2] = [0.15, 0.45];
/// Huber's constant: 95 % efficiency for normal errors.
const HUBER: f64 = 1.345;
/// Residuals, in standard deviations, between which a weight falls on to nothing: a gross error has no say at all (Hampel
/// 1974, three-part function).
const DESCEND: f64 = 4.0;
const VANISH: f64 = 8.0;
const ITERATIONS: usize = 25;
/// Weight below which a row has no say in the choice of the function beside the law.
const GROSS: f64 = 0.2;

/// Where a fit stands: the unknowns, those of the functions beside the law behind them, and the rows' weights.
pub(super) struct Fitted {
    pub(super) unknowns: Vec<f64>,
    pub(super) weight: Vec<f64>,
}

impl Problem<'_> {
    /// Iterates to the solution for one shape of the function beside the law.
    pub(super) fn converge(
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
        let mut step = Stacked::new(&linear, fitted, &prior_se).solve();
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
            step = Stacked::new(&linear, fitted, &prior_se).solve();
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
    pub(super) fn likeliest(&self, fitted: &Fitted, points: &[[f64; 3]]) -> Result<Shape, InputError> {
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
            let stacked = Stacked::new(&linear, &at, &self.prior_se(count));
            let of_sigma: f64 = linear.sigma.iter().zip(&at.weight).map(|(s, w)| 2.0 * w * s.ln()).sum();
            let score = of_sigma + stacked.unlikelihood();
            if score < best.0 {
                best = (score, shape);
            }
        }
        Ok(best.1)
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
