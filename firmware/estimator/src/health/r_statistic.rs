//! Steady-state detection by the R-statistic (Cao and Rhinehart 1995, J. Process Control 5).
//!
//! The variance of a signal is estimated in two ways: from the distance to a moving average, and from the difference of
//! successive values. Pure noise gives the same in both up to a known factor, a trend raises the first. In addition to
//! their ratio `R` there is a floor: a deviation too small to affect the flow balance counts as steady whatever its
//! shape, since recorders that round or hold values leave no noise from which to form a ratio.

use serde::{Deserialize, Serialize};

use super::tuning::{
    AVERAGE_WEIGHT, DIFFERENCE_WEIGHT, DISTANCE_WEIGHT, JUMP_FLOORS, R_CRITICAL, RESTART_FLOORS,
};

/// Steady-state detector of one signal.
#[doc(alias = "Cao and Rhinehart")]
#[doc(alias = "steady-state identification")]
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct RStatistic {
    average: f32,
    last: f32,
    distance2: f32,
    difference2: f32,
}

impl RStatistic {
    /// Detector initialised with one value.
    #[must_use]
    pub const fn new(value: f32) -> Self {
        Self { average: value, last: value, distance2: 0.0, difference2: 0.0 }
    }

    /// Adds a value; true when the signal is steady. `floor` is the root mean square deviation that counts as steady.
    ///
    /// A jump larger than noise restarts the filter as unsteady: otherwise the square of a large change would keep it
    /// unsteady long after the signal has settled.
    pub fn push(&mut self, value: f32, floor: f32) -> bool {
        if (value - self.last).abs() > JUMP_FLOORS * floor {
            let restart2 = RESTART_FLOORS * RESTART_FLOORS * floor * floor;
            *self = Self { average: value, last: value, distance2: restart2, difference2: 0.0 };
            return false;
        }
        let distance = value - self.average;
        let difference = value - self.last;
        self.distance2 += DISTANCE_WEIGHT * (distance * distance - self.distance2);
        self.average += AVERAGE_WEIGHT * distance;
        self.difference2 += DIFFERENCE_WEIGHT * (difference * difference - self.difference2);
        self.last = value;
        self.distance2 <= floor * floor
            || (2.0 - AVERAGE_WEIGHT) * self.distance2 <= R_CRITICAL * self.difference2
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

    /// Below the noise's standard deviation, so that the R-statistic decides; large enough that noise does not jump.
    const FLOOR: f32 = 0.9;

    #[test]
    fn noise_alone_is_steady_and_a_ramp_is_not() {
        let mut state = 1;
        let mut filter = RStatistic::new(0.0);
        let steady = (0..20_000).filter(|_| filter.push(noise(&mut state), FLOOR)).count();
        // Less than a tenth of pure noise counts as a trend.
        assert!((18_000..20_000).contains(&steady), "{steady}");
        let mut filter = RStatistic::new(0.0);
        let steady = (0..20_000).filter(|i| filter.push(*i as f32 * 1.5 + noise(&mut state), FLOOR)).count();
        assert!(steady < 200, "{steady}");
    }

    #[test]
    fn held_values_are_steady_below_the_floor() {
        let mut filter = RStatistic::new(5.0);
        assert!((0..10).all(|_| filter.push(5.0, 0.1)));
        // After a jump the signal counts as unsteady for seven values and no longer.
        let after: u32 = (0..20).map(|_| u32::from(filter.push(6.0, 0.1))).sum();
        assert_eq!(after, 13);
    }
}
