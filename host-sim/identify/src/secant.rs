//! Leakage coefficient of one point by the safeguarded secant method (paper eq. 8).
//!
//! `f(Kou) = r` is solved, `f` being a model whose ratio falls with Kou. The secant step is taken as it comes, but never
//! out of the bracket that earlier calls have established, never below zero and never more often than allowed. A ratio
//! above the leak-free ratio has no solution; that is said, with the leak-free ratio, and not turned into a negative Kou.

use kou_lumped::SimError;

use super::ratio_model::{OperatingPoint, RatioModel};

/// How to search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Secant {
    /// Stopping rule of the paper: `|f - r|/r` below this.
    pub tolerance: f64,
    /// Two different starting values, not negative; without them, from the reduced model's inverse.
    pub start: Option<[f64; 2]>,
    /// Most calls of the model for one point.
    pub max_calls: u32,
}

impl Default for Secant {
    fn default() -> Self {
        // 1e-4 of ratio is 0.3 % of Kou at 1000 r/min; the paper's 5e-3 would be 7 to 13 %.
        Self { tolerance: 1e-4, start: None, max_calls: 20 }
    }
}

/// A point that was solved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Found {
    /// Leakage coefficient.
    pub kou: f64,
    /// Ratio that the model gives with it.
    pub ratio: f64,
    /// Calls of the model that it took.
    pub calls: u32,
}

/// Why a point was not solved.
#[derive(Debug, Clone, PartialEq)]
pub enum NotFound {
    /// The measured ratio is above the ratio without leakage.
    AboveLeakFree {
        /// That ratio.
        leak_free_ratio: f64,
    },
    /// The stopping rule was not met within the allowed calls.
    TooManyCalls {
        /// Relative error of the ratio that was left.
        error: f64,
    },
    /// The model failed.
    Model(SimError),
}

/// What is known of the solution: `f` is above `r` at `below`, and below `r` at `above`.
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

    /// `wanted` where the bracket allows it, otherwise a point inside it.
    fn admit(&self, wanted: f64) -> f64 {
        match (self.below, self.above) {
            _ if wanted.is_finite()
                && wanted > self.below.unwrap_or(0.0)
                && self.above.is_none_or(|a| wanted < a) =>
            {
                wanted
            }
            (Some(below), Some(above)) => 0.5 * (below + above),
            // Not even zero was tried: f(0) decides whether there is a solution at all.
            (None, _) => 0.0,
            (Some(below), None) => 2.0 * below + 1e-4,
        }
    }
}

/// Finds the leakage coefficient that explains `ratio` at a point.
///
/// # Errors
/// A ratio that no leakage explains, too many calls, or a failure of the model.
pub fn solve(
    model: &dyn RatioModel,
    at: &OperatingPoint,
    ratio: f64,
    start: [f64; 2],
    how: &Secant,
) -> Result<Found, NotFound> {
    let mut calls = 0;
    let mut bracket = Bracket::default();
    let mut last: Option<(f64, f64)> = None;
    let mut kou = start[0].max(0.0);
    let mut error = f64::INFINITY;
    while calls < how.max_calls {
        calls += 1;
        let excess = match model.solve(at, kou) {
            Ok(solved) => solved.ratio.abs() - ratio.abs(),
            // So much leakage that nothing is left for the motor: too much.
            Err(SimError::Unreachable { .. }) if kou > 0.0 => {
                bracket.above = Some(bracket.above.map_or(kou, |a| a.min(kou)));
                kou = bracket.admit(0.5 * (kou + bracket.below.unwrap_or(0.0)));
                continue;
            }
            Err(other) => return Err(NotFound::Model(other)),
        };
        error = excess.abs() / ratio.abs();
        if error < how.tolerance {
            return Ok(Found { kou, ratio: ratio.signum() * (ratio.abs() + excess), calls });
        }
        if kou == 0.0 && excess < 0.0 {
            return Err(NotFound::AboveLeakFree { leak_free_ratio: ratio.signum() * (ratio.abs() + excess) });
        }
        bracket.add(kou, excess);
        let next = match last {
            None => start[1].max(0.0),
            Some((k, e)) => bracket.admit(kou - excess * (kou - k) / (excess - e)),
        };
        last = Some((kou, excess));
        kou = if next == kou { bracket.admit(f64::NAN) } else { next };
    }
    Err(NotFound::TooManyCalls { error })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ratio_model::{Change, Solved};
    use kou_records::InputError;

    /// Deliberately not linear: the secant must iterate.
    struct Curved;

    impl RatioModel for Curved {
        fn solve(&self, _: &OperatingPoint, kou: f64) -> Result<Solved, SimError> {
            if kou > 0.5 {
                return Err(SimError::Unreachable { wanted: String::new(), reason: String::new() });
            }
            Ok(Solved { ratio: 0.95 * (-2.0 * kou).exp(), p_l_mpa: 1.5 })
        }

        fn changed(&self, _: Change) -> Result<Box<dyn RatioModel + '_>, InputError> {
            Ok(Box::new(Self))
        }
    }

    const AT: OperatingPoint =
        OperatingPoint { n_p_rpm: 1000.0, p_h_mpa: 30.0, p_l_mpa: None, t_b_c: 60.0, alpha: 1.0 };

    #[test]
    fn curved_model_is_solved_from_any_start_also_a_bad_one() {
        let how = Secant { tolerance: 1e-8, start: None, max_calls: 30 };
        for start in [[0.0, 0.1], [0.3, 0.300_001], [0.4, 0.49], [0.9, 0.8], [0.05, 0.05], [1e-3, 2.0]] {
            let found = solve(&Curved, &AT, 0.95 * (-0.2_f64).exp(), start, &how).unwrap();
            // A relative error of the ratio of 1e-8 is half of that in Kou.
            assert!((found.kou - 0.1).abs() < 1e-8, "{start:?}: {found:?}");
        }
    }

    #[test]
    fn ratio_above_the_leak_free_one_is_named_and_never_a_negative_coefficient() {
        let found = solve(&Curved, &AT, 0.97, [0.01, 0.02], &Secant::default());
        assert_eq!(found, Err(NotFound::AboveLeakFree { leak_free_ratio: 0.95 }));
    }

    #[test]
    fn calls_are_limited() {
        let how = Secant { tolerance: 1e-12, start: None, max_calls: 3 };
        assert!(matches!(
            solve(&Curved, &AT, 0.7, [0.0, 0.4], &how),
            Err(NotFound::TooManyCalls { error }) if error > 0.0
        ));
    }
}
