//! Calibrated region: the operating points at which a leakage law was calibrated, and the test whether a point is
//! inside.
//!
//! The region is convex: the points' bounding box in the law's normalised variables x, y, z, cut by the planes at 45
//! degrees between each two axes (a discrete oriented polytope with nine directions, k-DOP). It contains every
//! calibration point, lies inside the bounding box, costs nine comparisons, and needs no hull algorithm on the
//! controller. A quadratic does not extrapolate, so outside the region the law is not used.

use serde::{Deserialize, Serialize};

/// A direction in normalised variables along which the region is bounded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Direction {
    /// `x = n_p/n_max`: pump speed.
    Speed,
    /// `y = p_H/p_max`: pressure.
    Pressure,
    /// `z = T_b/T_max`: temperature.
    Temperature,
    /// `x + y`.
    SpeedPlusPressure,
    /// `x - y`.
    SpeedMinusPressure,
    /// `x + z`.
    SpeedPlusTemperature,
    /// `x - z`.
    SpeedMinusTemperature,
    /// `y + z`.
    PressurePlusTemperature,
    /// `y - z`.
    PressureMinusTemperature,
}

impl Direction {
    /// Every direction, in the order of [`RegionConfig::bounds`].
    pub const ALL: [Self; 9] = [
        Self::Speed,
        Self::Pressure,
        Self::Temperature,
        Self::SpeedPlusPressure,
        Self::SpeedMinusPressure,
        Self::SpeedPlusTemperature,
        Self::SpeedMinusTemperature,
        Self::PressurePlusTemperature,
        Self::PressureMinusTemperature,
    ];

    /// Name as reports and files print it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Speed => "speed",
            Self::Pressure => "pressure",
            Self::Temperature => "temperature",
            Self::SpeedPlusPressure => "speed_plus_pressure",
            Self::SpeedMinusPressure => "speed_minus_pressure",
            Self::SpeedPlusTemperature => "speed_plus_temperature",
            Self::SpeedMinusTemperature => "speed_minus_temperature",
            Self::PressurePlusTemperature => "pressure_plus_temperature",
            Self::PressureMinusTemperature => "pressure_minus_temperature",
        }
    }

    /// Co-ordinate of a point along this direction.
    #[inline(always)]
    #[must_use]
    pub fn of(self, [x, y, z]: [f32; 3]) -> f32 {
        match self {
            Self::Speed => x,
            Self::Pressure => y,
            Self::Temperature => z,
            Self::SpeedPlusPressure => x + y,
            Self::SpeedMinusPressure => x - y,
            Self::SpeedPlusTemperature => x + z,
            Self::SpeedMinusTemperature => x - z,
            Self::PressurePlusTemperature => y + z,
            Self::PressureMinusTemperature => y - z,
        }
    }
}

/// Closed interval along one direction, in normalised variables.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bound {
    /// Smallest co-ordinate of the region.
    pub min: f32,
    /// Largest co-ordinate of the region.
    pub max: f32,
}

/// Calibrated region as written in a calibration.
#[doc(alias = "k-DOP")]
#[doc(alias = "discrete oriented polytope")]
#[doc(alias = "convex hull")]
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RegionConfig {
    /// Along `x = n_p/n_max`.
    pub speed: Bound,
    /// Along `y = p_H/p_max`.
    pub pressure: Bound,
    /// Along `z = T_b/T_max`.
    pub temperature: Bound,
    /// Along `x + y`.
    pub speed_plus_pressure: Bound,
    /// Along `x - y`.
    pub speed_minus_pressure: Bound,
    /// Along `x + z`.
    pub speed_plus_temperature: Bound,
    /// Along `x - z`.
    pub speed_minus_temperature: Bound,
    /// Along `y + z`.
    pub pressure_plus_temperature: Bound,
    /// Along `y - z`.
    pub pressure_minus_temperature: Bound,
}

impl RegionConfig {
    /// Smallest region that contains all `points` (normalised x, y, z), widened by `margin` on every side.
    ///
    /// Without points the result is empty, which the checked constructor rejects.
    pub fn around(points: impl IntoIterator<Item = [f32; 3]>, margin: f32) -> Self {
        let mut bounds = [Bound { min: f32::MAX, max: f32::MIN }; 9];
        for point in points {
            for (bound, direction) in bounds.iter_mut().zip(Direction::ALL) {
                let along = direction.of(point);
                bound.min = bound.min.min(along - margin);
                bound.max = bound.max.max(along + margin);
            }
        }
        let [
            speed,
            pressure,
            temperature,
            speed_plus_pressure,
            speed_minus_pressure,
            speed_plus_temperature,
            speed_minus_temperature,
            pressure_plus_temperature,
            pressure_minus_temperature,
        ] = bounds;
        Self {
            speed,
            pressure,
            temperature,
            speed_plus_pressure,
            speed_minus_pressure,
            speed_plus_temperature,
            speed_minus_temperature,
            pressure_plus_temperature,
            pressure_minus_temperature,
        }
    }

    /// Bounds in the order of [`Direction::ALL`].
    #[must_use]
    pub const fn bounds(&self) -> [Bound; 9] {
        [
            self.speed,
            self.pressure,
            self.temperature,
            self.speed_plus_pressure,
            self.speed_minus_pressure,
            self.speed_plus_temperature,
            self.speed_minus_temperature,
            self.pressure_plus_temperature,
            self.pressure_minus_temperature,
        ]
    }

    /// First direction along which `point` is outside, or `None` when it is inside.
    #[inline]
    #[must_use]
    pub fn outside(&self, point: [f32; 3]) -> Option<Direction> {
        self.bounds().into_iter().zip(Direction::ALL).find_map(|(bound, direction)| {
            let along = direction.of(point);
            // Written so that NaN counts as outside.
            if along >= bound.min && along <= bound.max { None } else { Some(direction) }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn region_contains_its_points_and_excludes_the_empty_corner() {
        // Three corners of a square: the fourth, (1, 1), is an extrapolation although the bounding box contains it.
        let points = [[0.2, 0.2, 0.5], [1.0, 0.2, 0.5], [0.2, 1.0, 0.5]];
        let region = RegionConfig::around(points, 1e-3);
        for point in points {
            assert_eq!(region.outside(point), None);
        }
        assert_eq!(region.outside([1.0, 1.0, 0.5]), Some(Direction::SpeedPlusPressure));
        assert_eq!(region.outside([0.5, 0.5, 0.6]), Some(Direction::Temperature));
    }

    #[test]
    fn nan_lies_outside() {
        let region = RegionConfig::around([[0.0; 3], [1.0; 3]], 0.0);
        assert_eq!(region.outside([f32::NAN, 0.5, 0.5]), Some(Direction::Speed));
    }
}
