//! Leakage coefficient of one point by the safeguarded secant method (Wang et al., eq. 8).
//!
//! Solves `f(Kou) = r` for a plant model `f` whose ratio decreases with Kou. A secant step outside the bracket of the
//! earlier evaluations is replaced by bisection (Dekker 1969); negative values are not tried, and the number of model calls
//! is limited. A ratio above the leak-free ratio has no solution and is reported with the leak-free ratio.

use kou_lumped::OperatingPoint;

use crate::plant_model::{PlantError, PlantModel};

/// Settings of the secant method.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SecantSettings {
    /// Stopping rule of the paper: `|f - r|/r` below this tolerance.
    pub tolerance: f64,
    /// Start interval, two different values, not negative; by default from the inverse of the reduced model.
    pub start: Option<[f64; 2]>,
    /// Maximum number of model calls for one point.
    pub max_calls: u32,
}

impl Default for SecantSettings {
    fn default() -> Self {
        // 1e-4 of ratio is 0.3 % of Kou at 1000 r/min; the paper's 5e-3 would be 7 to 13 %.
        Self { tolerance: 1e-4, start: None, max_calls: 20 }
    }
}

/// Solution of one point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SecantSolution {
    /// Leakage coefficient.
    pub kou: f64,
    /// Speed ratio of the model with this coefficient.
    pub ratio: f64,
    /// Number of model calls.
    pub calls: u32,
}

/// Reason why a point has no solution.
#[derive(Debug, Clone, PartialEq)]
pub enum SecantError {
    /// The measured ratio is above the ratio without leakage.
    AboveLeakFree {
        /// Ratio without leakage.
        leak_free_ratio: f64,
    },
    /// The stopping rule was not met within the maximum number of calls.
    TooManyCalls {
        /// Remaining relative error of the ratio.
        error: f64,
    },
    /// Failure of the plant model.
    Plant(PlantError),
}

/// Bracket of the solution: `f > r` at `below`, `f < r` at `above`.
#[derive(Debug, Default)]
struct Bracket {
    below: Option<f64>,
    above: Option<f64>,
}

impl Bracket {
    fn add(&mut self, kou: f64, excess: f64) {
        if excess > 0.0 {
            self.below = Some(self.below.map_or(kou, |b| b.max(kou)));
        } else {
            self.above = Some(self.above.map_or(kou, |a| a.min(kou)));
        }
    }

    /// The proposed value if it is inside the bracket, otherwise the midpoint or an extension of the bracket.
    fn safeguard(&self, proposed: f64) -> f64 {
        match (self.below, self.above) {
            _ if proposed.is_finite()
                && proposed > self.below.unwrap_or(0.0)
                && self.above.is_none_or(|a| proposed < a) =>
            {
                proposed
            }
            (Some(below), Some(above)) => 0.5 * (below + above),
            // f(0) decides whether a solution exists.
            (None, _) => 0.0,
            (Some(below), None) => 2.0 * below + 1e-4,
        }
    }
}

/// Solves for the leakage coefficient of a measured ratio at an operating point.
///
/// # Errors
/// A ratio above the leak-free ratio, too many calls, or a failure of the model.
pub fn solve(
    model: &dyn PlantModel,
    at: &OperatingPoint,
    ratio: f64,
    start: [f64; 2],
    settings: &SecantSettings,
) -> Result<SecantSolution, SecantError> {
    let mut calls = 0;
    let mut bracket = Bracket::default();
    let mut last: Option<(f64, f64)> = None;
    let mut kou = start[0].max(0.0);
    let mut error = f64::INFINITY;
    while calls < settings.max_calls {
        calls += 1;
        let excess = match model.solve(at, kou) {
            Ok(response) => response.ratio.abs() - ratio.abs(),
            // The leakage exceeds the flow of the pump: an upper bound.
            Err(PlantError::Unreachable(_)) if kou > 0.0 => {
                bracket.above = Some(bracket.above.map_or(kou, |a| a.min(kou)));
                kou = bracket.safeguard(0.5 * (kou + bracket.below.unwrap_or(0.0)));
                continue;
            }
            Err(other) => return Err(SecantError::Plant(other)),
        };
        error = excess.abs() / ratio.abs();
        if error < settings.tolerance {
            return Ok(SecantSolution { kou, ratio: ratio.signum() * (ratio.abs() + excess), calls });
        }
        if kou == 0.0 && excess < 0.0 {
            return Err(SecantError::AboveLeakFree {
                leak_free_ratio: ratio.signum() * (ratio.abs() + excess),
            });
        }
        bracket.add(kou, excess);
        let next = match last {
            None => start[1].max(0.0),
            Some((k, e)) => bracket.safeguard(kou - excess * (kou - k) / (excess - e)),
        };
        last = Some((kou, excess));
        kou = if next == kou { bracket.safeguard(f64::NAN) } else { next };
    }
    Err(SecantError::TooManyCalls { error })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant_model::{MachineCorrection, SteadyResponse};
    use kou_records::InputError;

    /// Nonlinear model, so that the secant method must iterate.
    struct ExponentialPlant;

    impl PlantModel for ExponentialPlant {
        fn solve(&self, _: &OperatingPoint, kou: f64) -> Result<SteadyResponse, PlantError> {
            if kou > 0.5 {
                return Err(PlantError::Unreachable(String::new()));
            }
            Ok(SteadyResponse { ratio: 0.95 * (-2.0 * kou).exp(), p_l_mpa: 1.5 })
        }

        fn corrected(&self, _: MachineCorrection) -> Result<Box<dyn PlantModel + '_>, InputError> {
            Ok(Box::new(Self))
        }
    }

    const AT: OperatingPoint =
        OperatingPoint { n_p_rpm: 1000.0, p_h_mpa: 30.0, p_l_mpa: None, t_b_c: 60.0, alpha: 1.0 };

    #[test]
    fn nonlinear_model_converges_from_any_start() {
        let settings = SecantSettings { tolerance: 1e-8, start: None, max_calls: 30 };
        for start in [[0.0, 0.1], [0.3, 0.300_001], [0.4, 0.49], [0.9, 0.8], [0.05, 0.05], [1e-3, 2.0]] {
            let found = solve(&ExponentialPlant, &AT, 0.95 * (-0.2_f64).exp(), start, &settings).unwrap();
            // A relative error of the ratio of 1e-8 is half of that in Kou.
            assert!((found.kou - 0.1).abs() < 1e-8, "{start:?}: {found:?}");
        }
    }

    #[test]
    fn ratio_above_the_leak_free_ratio_is_an_error_and_not_a_negative_coefficient() {
        let found = solve(&ExponentialPlant, &AT, 0.97, [0.01, 0.02], &SecantSettings::default());
        assert_eq!(found, Err(SecantError::AboveLeakFree { leak_free_ratio: 0.95 }));
    }

    #[test]
    fn calls_are_limited() {
        let settings = SecantSettings { tolerance: 1e-12, start: None, max_calls: 3 };
        assert!(matches!(
            solve(&ExponentialPlant, &AT, 0.7, [0.0, 0.4], &settings),
            Err(SecantError::TooManyCalls { error }) if error > 0.0
        ));
    }
}
