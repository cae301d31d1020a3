//! Selection of the discrepancy's kernel by restricted maximum likelihood.

use kou_records::InputError;

use crate::discrepancy::{Basis, Kernel};
use crate::joint::linear::{FitState, JointProblem};

/// Rows with a robust weight below this are outliers and do not count.
const MIN_WEIGHT: f64 = 0.2;

impl JointProblem<'_> {
    /// Kernel of maximum restricted likelihood of the linearised problem (Patterson and Thompson 1971), all unknowns integrated
    /// out; the flat prior of the law makes the marginal likelihood the restricted one (Harville 1974).
    #[doc(alias = "REML")]
    #[doc(alias = "restricted likelihood")]
    pub(super) fn select_hyperparameters(
        &self,
        state: &FitState,
        points: &[[f64; 3]],
    ) -> Result<Kernel, InputError> {
        let mut at =
            FitState { unknowns: state.unknowns[..self.parameters()].to_vec(), weight: state.weight.clone() };
        for weight in at.weight.iter_mut().filter(|w| **w >= MIN_WEIGHT) {
            *weight = 1.0;
        }
        let mut best = (f64::INFINITY, Kernel::NONE);
        let mut basis = Basis::over(&[], 1.0);
        let mut length_scale = 0.0;
        for kernel in Kernel::candidates() {
            if kernel.length_scale != length_scale {
                length_scale = kernel.length_scale;
                basis = Basis::over(points, length_scale);
            }
            let count = self.parameters() + basis.count();
            at.unknowns.resize(count, 0.0);
            let linear = self.linearise(&at.unknowns, &basis, kernel)?;
            let problem = self.least_squares(&linear, &at);
            let of_sigma: f64 = linear.sigma.iter().zip(&at.weight).map(|(s, w)| 2.0 * w * s.ln()).sum();
            let score = of_sigma + problem.neg2_log_reml();
            if score < best.0 {
                best = (score, kernel);
            }
        }
        Ok(best.1)
    }
}
