//! What an identification says: the calibration, and everything by which an engineer judges it.

use kou_estimator::{Calibration, Params, Reason};

use super::joint::Solution;
use super::law_fit::{LawFit, phi};
use super::ratio_model::{Change, OperatingPoint};
use super::surrogate::Surrogate;
use kou_records::BenchPoint;
use kou_records::InputError;

/// One point with what was made of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointResult {
    /// The point.
    pub point: BenchPoint,
    /// Leakage coefficient that explains its ratio.
    pub kou: f64,
    /// Leakage coefficient by the law.
    pub kou_law: f64,
    /// Standard error of the law here: coefficients and misfit.
    pub kou_law_se: f64,
    /// Speed ratio by the identified law, by the estimator's own code.
    pub ratio_by_law: f64,
    /// Relative error of the ratio here by the law that the other points alone would have given.
    pub leave_one_out: f64,
    /// Robust weight, 1 for a point that is believed.
    pub weight: f64,
    /// Calls of the model that this point took; zero where the points were not solved one by one.
    pub calls: u32,
}

impl PointResult {
    /// Whether the point was given less than half its weight.
    #[must_use]
    pub fn is_outlier(&self) -> bool {
        self.weight < 0.5
    }
}

/// A point that was not used.
#[derive(Debug, Clone, PartialEq)]
pub struct Refusal {
    /// The point.
    pub point: BenchPoint,
    /// Why, as reports print it.
    pub reason: String,
    /// The leak-free ratio at the point, where that is the reason.
    pub leak_free_ratio: Option<f64>,
}

impl Refusal {
    /// A ratio that no leakage explains.
    #[must_use]
    pub fn above_leak_free(point: BenchPoint, leak_free_ratio: f64) -> Self {
        let reason = Reason::RatioAboveLeakFree.name().to_string();
        Self { point, reason, leak_free_ratio: Some(leak_free_ratio) }
    }
}

/// One quantity that was fitted.
#[derive(Debug, Clone, PartialEq)]
pub struct Unknown {
    /// Its name: a term of the law, `displacement`, `bulk_modulus` or `alpha_0.30`.
    pub name: String,
    /// Its value: a coefficient, or a relative change.
    pub value: f64,
    /// Standard error.
    pub se: f64,
    /// Standard error beforehand; nothing where nothing was known.
    pub prior_se: Option<f64>,
}

impl Unknown {
    /// Whether the points say more about it than was known beforehand.
    #[must_use]
    pub fn by_data(&self) -> bool {
        self.prior_se.is_none_or(|prior| self.se < 0.5 * prior)
    }
}

/// Result of an identification.
#[derive(Debug, Clone)]
pub struct Identification {
    /// The calibration; it has passed the estimator's checks.
    pub calibration: Calibration,
    /// Law, region and dropped terms.
    pub fit: LawFit,
    /// Points that were used.
    pub points: Vec<PointResult>,
    /// Points that were not.
    pub refused: Vec<Refusal>,
    /// Mean relative error of the ratio by the law, in per cent.
    pub ratio_error_mean_pct: f64,
    /// What was fitted besides points' coefficients; empty for the two-step scheme.
    pub unknowns: Vec<Unknown>,
    /// Correlation of the unknowns, row by row.
    pub correlation: Vec<Vec<f64>>,
    /// Squared whitened residuals per degree of freedom; zero for the two-step scheme.
    pub chi2_per_freedom: f64,
    /// How the machine was found to differ from its file.
    pub change: Change,
    /// The surrogate, where a full model was at hand.
    pub surrogate: Option<Surrogate>,
    /// Calls of the model, surrogate included.
    pub model_calls: u32,
    /// The joint fit behind the law; nothing for the two-step scheme.
    pub solution: Option<Solution>,
}

/// Refuses a table of which no point is left.
///
/// # Errors
/// When `used` is zero; the message quotes the first refusal.
pub fn demand_points(used: usize, refused: &[Refusal]) -> Result<(), InputError> {
    if used > 0 {
        return Ok(());
    }
    let Some(first) = refused.first() else { return Err(InputError::new("has no points")) };
    let line = first.point.line;
    Err(match first.leak_free_ratio {
        Some(leak_free) => InputError::new(format!(
            "every measured ratio is above the leak-free ratio, so no leakage explains it (is the machine file's \
             displacement right?; line {line}: {} against {leak_free:.4})",
            first.point.ratio
        )),
        None => InputError::new(format!("no point could be used; line {line}: {}", first.reason)),
    })
}

/// Speed ratio by the calibrated law at a point, by the estimator's own code.
#[must_use]
#[allow(clippy::cast_possible_truncation, reason = "the estimator works in f32")]
pub fn ratio_by_law(params: &Params, at: &OperatingPoint, low_mpa: f64) -> f64 {
    use kou_estimator::units::{Celsius, Megapascal, Ratio, RevPerMin};
    let point = kou_estimator::model::flow_balance::OperatingPoint {
        pump_speed: RevPerMin(at.n_p_rpm as f32),
        high_pressure: Megapascal(at.p_h_mpa as f32),
        low_pressure: Megapascal(at.p_l_mpa.unwrap_or(low_mpa) as f32),
        oil_temperature: Celsius(at.t_b_c as f32),
        displacement: Ratio(at.alpha as f32),
    };
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

/// Law in f64, for reports.
#[must_use]
pub fn evaluate(fit: &LawFit, point: &BenchPoint) -> f64 {
    let x = super::law_fit::normalised(&fit.law, point.n_p_rpm, point.p_h_mpa, point.t_b_c);
    super::law_fit::coefficients(&fit.law).iter().zip(phi(x)).map(|(k, f)| k * f).sum()
}
