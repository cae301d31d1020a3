//! A space-filling set of operating points over the envelope in which reduced and full model are compared.
//!
//! Halton's sequence, so that the first n points fill the envelope for every n and two sets that begin at different
//! indices share no point. Kou is spread evenly from its smallest value to what takes the allowed share of the flow.

use super::ratio_model::{OperatingPoint, ReducedRatio};

/// Ranges of operating points.
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
    /// Largest share of the pump's flow that leakage takes.
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

/// Halton's radical inverse, 0 to 1.
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
    /// The point with this index, and its leakage coefficient. The reduced model tells how much the pump delivers.
    #[must_use]
    pub fn point(&self, index: u32, reduced: &ReducedRatio) -> (OperatingPoint, f64) {
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
