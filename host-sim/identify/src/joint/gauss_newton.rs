//! Gauss-Newton iteration with robust weights (iteratively reweighted least squares).

use kou_records::InputError;

use crate::discrepancy::{Basis, Kernel};
use crate::joint::least_squares::GaussNewtonStep;
use crate::joint::linear::{FitState, JointProblem, LinearisedModel};

/// Bounds of the relative corrections of displacement and bulk modulus.
const MAX_CORRECTION: [f64; 2] = [0.15, 0.45];
/// Huber's constant: 95 % efficiency for normal errors (Huber 1964).
const HUBER: f64 = 1.345;
/// Residual, in standard deviations, above which the influence decreases: redescending part of the three-part function
/// (Hampel 1974).
const HAMPEL_B: f64 = 4.0;
/// Residual, in standard deviations, above which a row has zero weight (Hampel 1974).
const HAMPEL_C: f64 = 8.0;
/// Maximum number of iterations.
const MAX_ITERATIONS: usize = 25;

impl JointProblem<'_> {
    /// Iterates to the solution for one kernel of the discrepancy.
    pub(super) fn converge(
        &self,
        state: &mut FitState,
        basis: &Basis,
        kernel: Kernel,
    ) -> Result<(LinearisedModel, GaussNewtonStep), InputError> {
        let count = self.parameters() + basis.count();
        state.unknowns.truncate(self.parameters());
        state.unknowns.resize(count, 0.0);
        let mut linear = self.linearise(&state.unknowns, basis, kernel)?;
        let mut step = self.least_squares(&linear, state).solve();
        for iteration in 0..MAX_ITERATIONS {
            let before = state.unknowns.clone();
            for (value, delta) in state.unknowns.iter_mut().zip(step.delta.iter()) {
                *value += delta;
            }
            for (value, largest) in state.unknowns.iter_mut().skip(self.law_terms).zip(MAX_CORRECTION) {
                *value = value.clamp(-largest, largest);
            }
            linear = self.linearise(&state.unknowns, basis, kernel)?;
            // Weights only after the first steps: residuals far from the solution do not identify outliers.
            if iteration >= 2 {
                state.weight = robust_weights(&linear, &step.leverage);
            }
            step = self.least_squares(&linear, state).solve();
            let parameters = state.unknowns.iter().zip(&before).take(self.parameters());
            let moved = parameters.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            // Parameters matter to 1e-4; the rounding of the f32 model limits convergence to about 1e-6.
            if iteration >= 4 && moved < 3e-6 {
                break;
            }
        }
        Ok((linear, step))
    }
}

/// Robust weights of the studentised residuals, scaled by their median absolute value.
#[doc(alias = "Huber")]
#[doc(alias = "Hampel")]
fn robust_weights(linear: &LinearisedModel, leverage: &[f64]) -> Vec<f64> {
    let standard: Vec<f64> =
        linear.residual.iter().zip(leverage).map(|(r, h)| r.abs() / (1.0 - h).max(1e-3).sqrt()).collect();
    let mut sorted = standard.clone();
    sorted.sort_by(f64::total_cmp);
    let median = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
    // 1.4826: ratio of standard deviation to median absolute deviation of a normal distribution. The scale is at least the
    // declared error.
    let scale = (1.4826 * median).max(1.0);
    let weight = |r: f64| {
        let huber = (HUBER * scale / r.max(1e-12)).min(1.0);
        huber * ((HAMPEL_C - r / scale) / (HAMPEL_C - HAMPEL_B)).clamp(0.0, 1.0)
    };
    standard.into_iter().map(weight).collect()
}
