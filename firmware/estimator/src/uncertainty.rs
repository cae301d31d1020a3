//! Standard error of the coefficient seen, from the standard errors of the sensors, to first order.
//!
//! `Kou = (A - |r| B) n_p / (1000 Lambda (p_H - p_c))`, so independent errors of ratio, pressure, temperature and
//! displacement add in squares, each times the derivative of Kou with respect to it. `docs/uncertainty.md` derives the
//! derivatives and says what is neglected.

use micromath::F32Ext;

use crate::calibration::SensorErrors;
use crate::reduced::{Balance, OperatingPoint, ReducedModel};
use crate::units::{LeakageCoefficient, Ratio};

/// Standard error of `kou`, which the inverse made of `ratio` at `at`.
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
    let per_chi = balance.kou_per_lost_fraction(model, ratio);
    let to_case_mpa = at.high_pressure.get() - model.config().case_pressure.get();
    let per_mpa = per_chi * model.compression().slope_per_mpa(at.oil_temperature) - kou.get() / to_case_mpa;
    let from_pressure = per_mpa * errors.high_pressure.get();

    let per_kelvin = per_chi * balance.lost_fraction().get() * model.compression().softening_per_k();
    let from_temperature = per_kelvin * errors.oil_temperature.get();

    let from_displacement = balance.kou_per_displacement(model) * errors.displacement.get();

    let variance = from_ratio * from_ratio
        + from_pressure * from_pressure
        + from_temperature * from_temperature
        + from_displacement * from_displacement;
    LeakageCoefficient(square_root(variance))
}

/// Square root to 1e-5 relative in some 20 instructions, the same bits on every machine.
///
/// micromath's inverse root is good to 3.4 %; each Newton step squares the error (times 3/2): 1.7e-3, then 4.5e-6.
#[inline]
fn square_root(value: f32) -> f32 {
    // Below the smallest normal number the estimate's bit trick fails; a standard error that small is zero.
    if value < f32::MIN_POSITIVE {
        return 0.0;
    }
    let half = 0.5 * value;
    let mut inverse = F32Ext::invsqrt(value);
    inverse *= 1.5 - half * inverse * inverse;
    inverse *= 1.5 - half * inverse * inverse;
    value * inverse
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn square_root_is_good_to_1e5_over_all_magnitudes() {
        let mut worst = 0.0_f64;
        for exponent in -37..38 {
            for step in 0..1000 {
                let value = (1.0 + 9.0 * step as f32 / 1000.0) * libm::powf(10.0, exponent as f32);
                if !value.is_normal() || !value.is_finite() {
                    continue;
                }
                let exact = libm::sqrt(f64::from(value));
                worst = worst.max((f64::from(square_root(value)) / exact - 1.0).abs());
            }
        }
        // Derived above: 4.5e-6, plus f32 rounding. A standard error needs two digits.
        assert!(worst < 1e-5, "{worst}");
    }

    #[test]
    fn square_root_of_zero_and_nan() {
        assert_eq!(square_root(0.0), 0.0);
        assert!(square_root(f32::NAN).is_nan());
    }
}
