//! Prognosis: trend of the level over operating hours, and the remaining life until a limit with its uncertainty.
//!
//! A straight line is fitted to the level by least squares with exponentially fading weights. The sums are taken about
//! the present time, so that they stay bounded however long the machine runs.

use serde::{Deserialize, Serialize};

use super::tuning::{
    CORRELATED_POINTS, MAX_REMAINING_H, REMAINING_SIGMAS, TREND_MEMORY_H, TREND_MIN_H, TREND_MIN_WEIGHT,
};
use crate::units::Ratio;

/// Weighted sums about the present time.
#[doc(alias = "exponentially weighted least squares")]
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LevelTrend {
    weight: f32,
    age: f32,
    age2: f32,
    level: f32,
    level_age: f32,
    level2: f32,
    hours: f32,
}

/// Slope of the level with its standard error.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Slope {
    /// Change of the level per hour.
    pub per_h: f32,
    /// Its standard error.
    pub per_h_se: f32,
}

/// Remaining life: time until the level reaches a limit.
#[doc(alias = "remaining useful life")]
#[doc(alias = "RUL")]
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct RemainingLife {
    /// Expected hours of driving with the gate open; at most 20000, also when the level does not rise.
    pub hours: f32,
    /// Hours if the slope were two standard errors steeper.
    pub at_least_hours: f32,
}

impl LevelTrend {
    /// Trend without points.
    #[must_use]
    pub const fn new() -> Self {
        Self { weight: 0.0, age: 0.0, age2: 0.0, level: 0.0, level_age: 0.0, level2: 0.0, hours: 0.0 }
    }

    /// Adds the level after another `hours` of driving with the gate open.
    pub fn push(&mut self, level: f32, hours: f32) {
        // All points age by `hours` (ages are negative) and fade.
        let (w, a) = (self.weight, self.age);
        self.age2 += hours * (hours * w - 2.0 * a);
        self.level_age -= hours * self.level;
        self.age -= hours * w;
        let fade = 1.0 - (hours / TREND_MEMORY_H).min(1.0);
        for sum in [
            &mut self.weight,
            &mut self.age,
            &mut self.age2,
            &mut self.level,
            &mut self.level_age,
            &mut self.level2,
        ] {
            *sum *= fade;
        }
        self.weight += 1.0;
        self.level += level;
        self.level2 += level * level;
        self.hours = (self.hours + hours).min(1e6);
    }

    /// Slope of the line, once enough hours have passed.
    #[must_use]
    pub fn slope(&self) -> Option<Slope> {
        if self.hours < TREND_MIN_H || self.weight < TREND_MIN_WEIGHT {
            return None;
        }
        let mean_age = self.age / self.weight;
        let mean_level = self.level / self.weight;
        let spread = self.age2 - self.age * mean_age;
        if spread <= 1e-6 {
            return None;
        }
        let per_h = (self.level_age - self.level * mean_age) / spread;
        let unexplained = (self.level2 - self.level * mean_level - per_h * per_h * spread).max(0.0);
        // Levels of neighbouring points are correlated, so that fewer of them are independent.
        let variance = CORRELATED_POINTS * unexplained / (self.weight * spread);
        Some(Slope { per_h, per_h_se: libm::sqrtf(variance) })
    }

    /// Remaining life until `level` reaches `limit`.
    #[must_use]
    pub fn remaining_life(&self, level: Ratio, limit: Ratio) -> Option<RemainingLife> {
        let slope = self.slope()?;
        let gap = (limit.get() - level.get()).max(0.0);
        let hours = |per_h: f32| {
            if per_h * MAX_REMAINING_H > gap { gap / per_h } else { MAX_REMAINING_H }
        };
        Some(RemainingLife {
            hours: hours(slope.per_h),
            at_least_hours: hours(slope.per_h + REMAINING_SIGMAS * slope.per_h_se),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn straight_rise_is_extrapolated_to_the_limit() {
        let mut trend = LevelTrend::default();
        // 1 % per hour, a point every 0.1 h, with a ripple of 0.5 %.
        let mut level = 1.0;
        for i in 0..100 {
            level = 1.0 + 0.001 * i as f32;
            trend.push(level + 0.005 * ((i * 37 % 11) as f32 / 5.0 - 1.0), 0.1);
        }
        let slope = trend.slope().unwrap();
        assert!((slope.per_h - 0.01).abs() < 3.0 * slope.per_h_se, "{slope:?}");
        assert!(slope.per_h_se < 0.002, "{slope:?}");
        let remaining = trend.remaining_life(Ratio(level), Ratio(1.5)).unwrap();
        assert!((remaining.hours / 40.0 - 1.0).abs() < 0.25 && remaining.at_least_hours < remaining.hours);
    }

    #[test]
    fn level_machine_lasts_as_long_as_is_stated_at_most() {
        let mut trend = LevelTrend::default();
        (0..1000).for_each(|_| trend.push(1.0, 0.1));
        assert_eq!(trend.remaining_life(Ratio(1.0), Ratio(1.5)).unwrap().hours, MAX_REMAINING_H);
    }

    #[test]
    fn sums_stay_bounded_for_a_million_hours() {
        let mut trend = LevelTrend::default();
        (0..1_000_000).for_each(|i| trend.push(1.0 + (i % 7) as f32 * 0.01, 1.0));
        assert!(trend.slope().unwrap().per_h.abs() < 1e-3);
        assert!(trend.weight < 30.0);
    }
}
