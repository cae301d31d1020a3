//! Result of an identification: the calibration and its diagnostics.

use kou_estimator::{Calibration, Params, Reason};

use kou_lumped::OperatingPoint;
use kou_records::{BenchPoint, InputError};

use crate::convert::estimator_point;
use crate::joint::JointSolution;
use crate::law_fit::LawFit;
use crate::plant_model::MachineCorrection;
use crate::surrogate::Surrogate;

/// Bench point with its identified leakage and diagnostics.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointResult {
    /// Bench point.
    pub point: BenchPoint,
    /// Leakage coefficient from the measured ratio.
    pub kou: f64,
    /// Leakage coefficient by the law.
    pub kou_law: f64,
    /// Standard error of the law at the point: coefficients and misfit.
    pub kou_law_se: f64,
    /// Speed ratio by the identified law, with the estimator's own code.
    pub ratio_by_law: f64,
    /// Leave-one-out error: relative error of the ratio by the law fitted without this point.
    pub leave_one_out: f64,
    /// Robust weight, 1 for an inlier.
    pub weight: f64,
    /// Model calls of this point; zero in the joint scheme.
    pub calls: u32,
}

impl PointResult {
    /// Whether the robust weight is below one half.
    #[must_use]
    pub fn is_outlier(&self) -> bool {
        self.weight < 0.5
    }
}

/// Bench point that was not used.
#[derive(Debug, Clone, PartialEq)]
pub struct RejectedPoint {
    /// Bench point.
    pub point: BenchPoint,
    /// Reason, as printed in reports.
    pub reason: String,
    /// Leak-free ratio at the point, if the measured ratio is above it.
    pub leak_free_ratio: Option<f64>,
}

impl RejectedPoint {
    /// Point with a measured ratio above the leak-free ratio.
    #[must_use]
    pub fn above_leak_free(point: BenchPoint, leak_free_ratio: f64) -> Self {
        let reason = Reason::RatioAboveLeakFree.name().to_string();
        Self { point, reason, leak_free_ratio: Some(leak_free_ratio) }
    }
}

/// Fitted parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct FittedParameter {
    /// Name: a term of the law, `displacement`, `bulk_modulus` or `alpha_0.30`.
    pub name: String,
    /// Value: a coefficient, or a relative correction.
    pub value: f64,
    /// Standard error.
    pub se: f64,
    /// Prior standard error; `None` without prior knowledge.
    pub prior_se: Option<f64>,
}

impl FittedParameter {
    /// Whether the points determine the parameter: the standard error is below half the prior's.
    #[must_use]
    pub fn by_data(&self) -> bool {
        self.prior_se.is_none_or(|prior| self.se < 0.5 * prior)
    }
}

/// Result of an identification.
#[derive(Debug, Clone)]
pub struct Identification {
    /// Calibration; has passed the estimator's checks.
    pub calibration: Calibration,
    /// Law, calibrated region and dropped terms.
    pub fit: LawFit,
    /// Points used.
    pub points: Vec<PointResult>,
    /// Points rejected.
    pub rejected: Vec<RejectedPoint>,
    /// Mean relative error of the ratio by the law, in per cent.
    pub ratio_error_mean_pct: f64,
    /// Fitted parameters; empty for the two-step scheme.
    pub parameters: Vec<FittedParameter>,
    /// Correlation matrix of the parameters, row by row.
    pub correlation: Vec<Vec<f64>>,
    /// Reduced chi-squared: squared whitened residuals per degree of freedom; zero for the two-step scheme.
    pub chi2_per_freedom: f64,
    /// Identified correction of the machine file.
    pub correction: MachineCorrection,
    /// Surrogate, if a plant model was given.
    pub surrogate: Option<Surrogate>,
    /// Model calls, those of the surrogate included.
    pub model_calls: u32,
    /// Solution of the joint fit; `None` for the two-step scheme.
    pub solution: Option<JointSolution>,
}

/// Checks that points remain.
///
/// # Errors
/// When `used` is zero; the message names the first rejected point.
pub fn require_points(used: usize, rejected: &[RejectedPoint]) -> Result<(), InputError> {
    if used > 0 {
        return Ok(());
    }
    let Some(first) = rejected.first() else { return Err(InputError::new("has no points")) };
    let line = first.point.line;
    Err(match first.leak_free_ratio {
        Some(leak_free) => InputError::new(format!(
            "every measured ratio is above the leak-free ratio, so no leakage explains it (is the machine file's \
             displacement correct?; line {line}: {} against {leak_free:.4})",
            first.point.ratio
        )),
        None => InputError::new(format!("no point could be used; line {line}: {}", first.reason)),
    })
}

/// Speed ratio by the calibrated law at a point, with the estimator's own code.
#[must_use]
pub fn ratio_by_law(params: &Params, at: &OperatingPoint, low_mpa: f64) -> f64 {
    let point = estimator_point(at, low_mpa);
    let law = params.law();
    let kou = law.evaluate(law.normalised(point.pump_speed, point.high_pressure, point.oil_temperature));
    f64::from(params.reduced().balance(&point).ratio(kou).get())
}

/// Mean relative error of the ratio by the law, in per cent.
#[must_use]
pub fn ratio_error_mean_pct(points: &[PointResult]) -> f64 {
    let sum: f64 = points.iter().map(|p| (p.ratio_by_law / p.point.ratio - 1.0).abs()).sum();
    100.0 * sum / points.len() as f64
}
