//! Standard error of the observed leakage coefficient, by first-order propagation of the sensors' standard errors.
//!
//! `Kou = (A - |r| B) n_p / (1000 Lambda (p_H - p_c))`, so independent errors of ratio, pressure, temperature and
//! displacement add in squares, each times the derivative of Kou with respect to it. `docs/uncertainty.md` derives the
//! derivatives and states what is neglected.

use crate::calibration::SensorErrors;
use crate::model::flow_balance::{Balance, OperatingPoint, ReducedModel};
use crate::model::sqrt::square_root;
use crate::units::{LeakageCoefficient, Ratio};

/// Standard error of `kou`, the inverse of the flow balance for `ratio` at `at`.
#[doc(alias = "error propagation")]
#[inline]
pub(crate) fn kou_standard_error(
    errors: &SensorErrors,
    model: &ReducedModel,
    balance: &Balance,
    at: &OperatingPoint,
    ratio: Ratio,
    kou: LeakageCoefficient,
) -> LeakageCoefficient {
    let per_ratio = balance.kou_per_ratio();
    let from_ratio = per_ratio * ratio.get() * errors.ratio_relative;

    // Pressure: directly through the leakage flow, and through chi at the oil's own compressibility.
    let per_chi = balance.kou_per_compression_loss(model, ratio);
    let to_case_mpa = at.high_pressure.get() - model.config().case_pressure.get();
    let per_mpa = per_chi * model.compression().slope_per_mpa(at.oil_temperature) - kou.get() / to_case_mpa;
    let from_pressure = per_mpa * at.high_pressure.get() * errors.high_pressure_relative;

    let per_kelvin = per_chi * balance.compression_loss().get() * model.compression().softening_per_k();
    let from_temperature = per_kelvin * errors.oil_temperature.get();

    let from_displacement = balance.kou_per_displacement(model) * errors.displacement.get();

    let variance = from_ratio * from_ratio
        + from_pressure * from_pressure
        + from_temperature * from_temperature
        + from_displacement * from_displacement;
    LeakageCoefficient(square_root(variance))
}
