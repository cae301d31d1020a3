//! Conversions between the f64 of the identification and the f32 of the estimator.

use kou_estimator::units::{Celsius, Megapascal, Ratio, RevPerMin};
use kou_lumped::OperatingPoint;
use kou_records::BenchPoint;

/// Rounds to the estimator's precision.
#[allow(clippy::cast_possible_truncation, reason = "the estimator works in f32")]
pub(crate) const fn single(value: f64) -> f32 {
    value as f32
}

/// Operating point at which a bench point was measured.
#[must_use]
pub fn operating_point(p: &BenchPoint) -> OperatingPoint {
    OperatingPoint {
        n_p_rpm: p.n_p_rpm,
        p_h_mpa: p.p_h_mpa,
        p_l_mpa: p.p_l_mpa,
        t_b_c: p.t_b_c,
        alpha: p.alpha,
    }
}

/// Operating point in the estimator's units; `low_mpa` is the low pressure where none was measured.
#[must_use]
pub fn estimator_point(
    at: &OperatingPoint,
    low_mpa: f64,
) -> kou_estimator::model::flow_balance::OperatingPoint {
    kou_estimator::model::flow_balance::OperatingPoint {
        pump_speed: RevPerMin(single(at.n_p_rpm)),
        high_pressure: Megapascal(single(at.p_h_mpa)),
        low_pressure: Megapascal(single(at.p_l_mpa.unwrap_or(low_mpa))),
        oil_temperature: Celsius(single(at.t_b_c)),
        displacement: Ratio(single(at.alpha)),
    }
}
