//! Identification with the reduced model: Kou of each point by its closed-form inverse, then the law.

use kou_estimator::reduced::{OperatingPoint, ReducedModel};
use kou_estimator::units::{Celsius, Megapascal, Ratio, RevPerMin};
use kou_estimator::{Params, Reason};

use super::law_fit::LawFit;
use crate::calibration::{Settings, assemble, oil_config, reduced_config};
use crate::input::InputError;
use crate::machine::Machine;
use crate::record::BenchPoint;

/// One point with what was made of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointResult {
    /// The point.
    pub point: BenchPoint,
    /// Leakage coefficient that explains its ratio.
    pub kou: f64,
    /// Speed ratio by the identified law.
    pub ratio_by_law: f64,
}

/// A point that no leakage explains.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Refusal {
    /// The point.
    pub point: BenchPoint,
    /// Why.
    pub reason: Reason,
    /// The leak-free ratio at the point.
    pub leak_free_ratio: f64,
}

/// Result of an identification.
#[derive(Debug, Clone)]
pub struct Identification {
    /// The calibration; it has passed the estimator's checks.
    pub calibration: kou_estimator::Calibration,
    /// The fit.
    pub fit: LawFit,
    /// Points that were used.
    pub points: Vec<PointResult>,
    /// Points that were not.
    pub refused: Vec<Refusal>,
    /// Mean relative error of the ratio by the law, in per cent.
    pub ratio_error_mean_pct: f64,
}

#[allow(clippy::cast_possible_truncation, reason = "the estimator works in f32")]
fn operating_point(machine: &Machine, point: &BenchPoint) -> OperatingPoint {
    OperatingPoint {
        pump_speed: RevPerMin(point.n_p_rpm as f32),
        high_pressure: Megapascal(point.p_h_mpa as f32),
        low_pressure: Megapascal(point.p_l_mpa.unwrap_or(machine.circuit().low_pressure_mpa) as f32),
        oil_temperature: Celsius(point.t_b_c as f32),
        displacement: Ratio(point.alpha as f32),
    }
}

/// Identifies a law from bench points.
///
/// # Errors
/// When no point can be explained by leakage, or the estimator refuses the resulting calibration.
pub fn by_reduced_model(
    machine: &Machine,
    points: &[BenchPoint],
    settings: &Settings,
) -> Result<Identification, InputError> {
    let reduced = reduced_config(machine);
    let model =
        ReducedModel::new(&reduced, &oil_config(machine)).map_err(|e| InputError::new(e.to_string()))?;
    let (mut explained, mut refused) = (Vec::new(), Vec::new());
    for point in points {
        let at = operating_point(machine, point);
        let balance = model.balance(&at);
        #[allow(clippy::cast_possible_truncation, reason = "the estimator works in f32")]
        let kou = f64::from(balance.kou(Ratio(point.ratio as f32)).get());
        if kou >= 0.0 && kou.is_finite() {
            explained.push((*point, kou));
        } else {
            let leak_free_ratio =
                f64::from(balance.ratio(kou_estimator::units::LeakageCoefficient(0.0)).get());
            refused.push(Refusal { point: *point, reason: Reason::RatioAboveLeakFree, leak_free_ratio });
        }
    }
    if explained.is_empty() {
        let example = refused.first().map_or(String::new(), |r| {
            format!("; line {}: {} against {:.4}", r.point.line, r.point.ratio, r.leak_free_ratio)
        });
        return Err(InputError::new(format!(
            "every measured ratio is above the leak-free ratio, so no leakage explains it (is the machine file's \
             displacement right?{example})"
        )));
    }
    let coordinates: Vec<[f64; 4]> =
        explained.iter().map(|(p, kou)| [p.n_p_rpm, p.p_h_mpa, p.t_b_c, *kou]).collect();
    let fit = LawFit::new(&coordinates);
    let calibration = assemble(machine, reduced, fit.law, fit.region, explained.len(), settings)?;
    let params = Params::new(&calibration)
        .map_err(|e| InputError::new(format!("the estimator refuses the identified calibration: {e}")))?;
    let points: Vec<PointResult> = explained
        .into_iter()
        .map(|(point, kou)| {
            let at = operating_point(machine, &point);
            let law = params.law();
            let by_law = law.evaluate(law.normalised(at.pump_speed, at.high_pressure, at.oil_temperature));
            let ratio_by_law = f64::from(params.reduced().balance(&at).ratio(by_law).get());
            PointResult { point, kou, ratio_by_law }
        })
        .collect();
    let error_sum: f64 = points.iter().map(|p| (p.ratio_by_law / p.point.ratio - 1.0).abs()).sum();
    let ratio_error_mean_pct = 100.0 * error_sum / points.len() as f64;
    Ok(Identification { calibration, fit, points, refused, ratio_error_mean_pct })
}
