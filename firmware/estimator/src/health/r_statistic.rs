//! Steady state by the R-statistic of Cao and Rhinehart (J. Process Control 5, 1995).
//!
//! The variance of a signal is estimated in two ways: from its distance to a moving average, and from the difference of
//! successive values. Noise alone gives both the same, up to a known factor; a trend raises the first. Beside their
//! ratio `R` there is a floor: a deviation that changes the flow balance by less than matters counts as steady whatever
//! its shape, since recorders that round or hold values have no noise from which to form a ratio.

use serde::{Deserialize, Serialize};

/// Weight of a new value in the moving average.
const L1: f32 = 0.3;
/// Weight of a new squared distance to the average.
const L2: f32 = 0.2;
/// Weight of a new squared difference of successive values.
const L3: f32 = 0.2;
/// Largest ratio that counts as steady. For these weights noise alone exceeds it in about 2 % of values (measured in
/// `noise_alone_is_steady_and_a_ramp_is_not`).
const R_CRITICAL: f32 = 2.5;

/// Change from one value to the next, in floors, that starts the filter anew.
const JUMP_FLOORS: f32 = 4.0;
/// Deviation, in floors, from which a restarted filter decays: with `L2` it opens after seven values.
const RESTART_FLOORS: f32 = 2.0;

/// Filter of one signal.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SteadyFilter {
    average: f32,
    last: f32,
    distance2: f32,
    difference2: f32,
}

impl SteadyFilter {
    /// A filter that knows one value.
    #[must_use]
    pub const fn new(value: f32) -> Self {
        Self { average: value, last: value, distance2: 0.0, difference2: 0.0 }
    }

    /// Takes a value; true when the signal is steady. `floor` is the root mean square deviation that does not matter.
    ///
    /// A value that leaps away from the last by more than noise can starts the filter anew, closed: else the square of a
    /// large change would keep it closed long after the signal has become steady.
    pub fn takes(&mut self, value: f32, floor: f32) -> bool {
        if (value - self.last).abs() > JUMP_FLOORS * floor {
            let restart2 = RESTART_FLOORS * RESTART_FLOORS * floor * floor;
            *self = Self { average: value, last: value, distance2: restart2, difference2: 0.0 };
            return false;
        }
        let distance = value - self.average;
        let difference = value - self.last;
        self.distance2 += L2 * (distance * distance - self.distance2);
        self.average += L1 * distance;
        self.difference2 += L3 * (difference * difference - self.difference2);
        self.last = value;
        self.distance2 <= floor * floor || (2.0 - L1) * self.distance2 <= R_CRITICAL * self.difference2
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Deterministic noise of variance 1: sum of twelve uniform values.
    fn noise(state: &mut u32) -> f32 {
        (0..12)
            .map(|_| {
                *state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (*state >> 8) as f32 / 16_777_216.0
            })
            .sum::<f32>()
            - 6.0
    }

    /// Below the noise's standard deviation, so that the R-statistic decides; large enough that noise does not leap.
    const FLOOR: f32 = 0.9;

    #[test]
    fn noise_alone_is_steady_and_a_ramp_is_not() {
        let mut state = 1;
        let mut filter = SteadyFilter::new(0.0);
        let steady = (0..20_000).filter(|_| filter.takes(noise(&mut state), FLOOR)).count();
        // A gate that is open nearly always: less than a tenth of noise alone is taken for a trend.
        assert!((18_000..20_000).contains(&steady), "{steady}");
        let mut filter = SteadyFilter::new(0.0);
        let steady = (0..20_000).filter(|i| filter.takes(*i as f32 * 1.5 + noise(&mut state), FLOOR)).count();
        assert!(steady < 200, "{steady}");
    }

    #[test]
    fn held_values_are_steady_below_the_floor() {
        let mut filter = SteadyFilter::new(5.0);
        assert!((0..10).all(|_| filter.takes(5.0, 0.1)));
        // After a leap the gate is shut for seven values and no longer.
        let after: u32 = (0..20).map(|_| u32::from(filter.takes(6.0, 0.1))).sum();
        assert_eq!(after, 13);
    }
}
