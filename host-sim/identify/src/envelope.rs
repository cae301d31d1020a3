//! Low-discrepancy set of operating points over an envelope, for fitting and validating the surrogate.
//!
//! Halton sequence (Halton 1960) with the bases 2, 3, 5, 7 and 11: the first n points fill the envelope for every n, and sets
//! with different start indices have no common point. Kou is uniform from its minimum to a maximum share of the pump flow.

use kou_lumped::OperatingPoint;

use crate::reduced_plant::ReducedPlant;

/// Ranges of operating points and leakage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Envelope {
    /// Pump speed, r/min.
    pub speed_rpm: [f64; 2],
    /// High pressure, MPa.
    pub pressure_mpa: [f64; 2],
    /// Oil temperature, degC.
    pub temperature_c: [f64; 2],
    /// Displacement fraction; every third point is at full displacement.
    pub alpha: [f64; 2],
    /// Leakage coefficient, (L/min)/MPa.
    pub kou: [f64; 2],
    /// Maximum leakage as a share of the pump flow.
    pub leakage_share: f64,
}

impl Default for Envelope {
    fn default() -> Self {
        Self {
            speed_rpm: [1000.0, 2800.0],
            pressure_mpa: [10.0, 50.0],
            temperature_c: [30.0, 90.0],
            alpha: [0.3, 1.0],
            kou: [0.0015, 0.36],
            leakage_share: 0.2,
        }
    }
}

/// Radical inverse of an index (van der Corput sequence in the given base), 0 to 1.
fn radical_inverse(mut index: u32, base: u32) -> f64 {
    let (mut fraction, mut sum) = (1.0, 0.0);
    while index > 0 {
        fraction /= f64::from(base);
        sum += fraction * f64::from(index % base);
        index /= base;
    }
    sum
}

impl Envelope {
    /// Operating point and leakage coefficient with this index of the sequence. The reduced model gives the pump flow.
    #[must_use]
    pub fn point(&self, index: u32, reduced: &ReducedPlant) -> (OperatingPoint, f64) {
        let within = |[low, high]: [f64; 2], base: u32| low + (high - low) * radical_inverse(index, base);
        let alpha = if index.is_multiple_of(3) { self.alpha[1] } else { within(self.alpha, 7) };
        let at = OperatingPoint {
            n_p_rpm: within(self.speed_rpm, 2),
            p_h_mpa: within(self.pressure_mpa, 3),
            p_l_mpa: None,
            t_b_c: within(self.temperature_c, 5),
            alpha,
        };
        let largest = self.leakage_share * reduced.ratio(&at, 0.0).abs() / reduced.slope(&at).abs();
        let [low, high] = [self.kou[0], largest.min(self.kou[1]).max(self.kou[0])];
        (at, low + (high - low) * radical_inverse(index, 11))
    }
}
