//! Compression of oil with entrained air between two pressures: Wylie's effective bulk modulus, integrated.
//!
//! With absolute pressure `p` and the relative air volume `x = (p_0/p)^(1/lambda)`, the effective bulk modulus (Wylie
//! and Streeter 1993, Fluid Transients in Systems; Wang et al. 2025, eq. 2) integrates to
//!
//! ```text
//! ln(rho_H/rho_L) = a(p_L) - a(p_H) + (h(p_H) - h(p_L))/beta_0
//! a(p) = ln(1 + c x(p))              contribution of the air
//! h(p) = integral dp/(1 + c x(p))    contribution of the oil itself, in MPa
//! ```
//!
//! and the compression loss is `chi = 1 - rho_L/rho_H`. Both functions depend on the calibration only, so the checked
//! constructor tabulates them, one polynomial per octave of absolute pressure, and a step needs no power function:
//! 2 x 231 instructions of `powf` become some 25. `docs/reduced-model.md` derives it and states the error, which
//! `tests/reference_f64.rs` bounds against adaptive quadrature in f64.

use serde::{Deserialize, Serialize};

use crate::units::{Celsius, MegapascalAbs, STANDARD_ATMOSPHERE_MPA};

/// Oil properties as written in a calibration.
#[doc(alias = "Wylie")]
#[doc(alias = "bulk modulus")]
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OilConfig {
    /// Bulk modulus of the oil without air, `beta_0`, in MPa, at `reference_c`.
    pub bulk_modulus_mpa: f32,
    /// Volume fraction of free air at a standard atmosphere, `c`.
    pub air_fraction: f32,
    /// Heat-capacity ratio of air (polytropic exponent), `lambda`.
    pub heat_capacity_ratio: f32,
    /// Relative change of the bulk modulus per kelvin; 0 for none. Typical oils lose 0.4 to 0.6 % per kelvin.
    pub bulk_modulus_per_k: f32,
    /// Temperature at which `bulk_modulus_mpa` holds.
    #[serde(rename = "reference_c")]
    pub reference: Celsius,
}

/// Smallest absolute pressure that the table covers, in MPa: 2^-5.
pub const MIN_PRESSURE_MPA_ABS: f32 = 0.031_25;
/// Absolute pressure at which the table ends, in MPa: 2^7.
pub const MAX_PRESSURE_MPA_ABS: f32 = 128.0;

const OCTAVES: usize = 12;
/// Biased exponent of [`MIN_PRESSURE_MPA_ABS`] in an f32: 127 - 5.
const FIRST_EXPONENT: u32 = 122;
/// Degree of the interpolating polynomials plus one.
const NODES: usize = 6;

/// `a(p)` and `h(p)` over one octave, as polynomials of `s = m - 3/2`, where `p = m 2^e` and `1 <= m < 2`.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Octave {
    air: [f32; NODES],
    oil: [f32; NODES + 1],
}

/// Compression of one oil by Wylie's bulk modulus, tabulated for evaluation.
#[doc(alias = "Wylie")]
#[doc(alias = "bulk modulus")]
#[doc(alias = "effective bulk modulus")]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Compression {
    octaves: [Octave; OCTAVES],
    per_bulk_modulus: f32,
    bulk_modulus_per_k: f32,
    reference_c: f32,
}

/// Chebyshev nodes on -1/2..1/2: cos((2i+1) pi/12)/2.
const NODE_AT: [f32; NODES] =
    [-0.482_962_9, -0.353_553_4, -0.129_409_52, 0.129_409_52, 0.353_553_4, 0.482_962_9];

impl Compression {
    /// Tabulates an oil whose configuration has been checked.
    pub(crate) fn from_checked(oil: &OilConfig) -> Self {
        let mut table = Self::empty(oil);
        table.tabulate(oil);
        table
    }

    /// As [`from_checked`](Self::from_checked) with an empty table, which is large: [`tabulate`](Self::tabulate) fills
    /// it in place.
    pub(crate) fn empty(oil: &OilConfig) -> Self {
        Self {
            octaves: [Octave { air: [0.0; NODES], oil: [0.0; NODES + 1] }; OCTAVES],
            per_bulk_modulus: 1.0 / oil.bulk_modulus_mpa,
            bulk_modulus_per_k: oil.bulk_modulus_per_k,
            reference_c: oil.reference.get(),
        }
    }

    /// Fills the table.
    // Not inlined: its temporaries would add to the stack of the callers.
    #[inline(never)]
    pub(crate) fn tabulate(&mut self, oil: &OilConfig) {
        let mut octave_mpa = MIN_PRESSURE_MPA_ABS;
        // h at the lower end of the octave; its zero is arbitrary, since only differences are used.
        let mut h_mpa = 0.0;
        for octave in &mut self.octaves {
            let free_air = NODE_AT
                .map(|s| oil.air_fraction * air_ratio(octave_mpa * (1.5 + s), oil.heat_capacity_ratio));
            octave.air = interpolate(free_air.map(libm::log1pf));
            let slope = interpolate(free_air.map(|u| 1.0 / (1.0 + u)));
            let [f0, f1, f2, f3, f4, f5] = slope;
            octave.oil = [0.0, f0, f1 / 2.0, f2 / 3.0, f3 / 4.0, f4 / 5.0, f5 / 6.0].map(|k| k * octave_mpa);
            // Continuous with the octave below.
            let from_start = h_mpa - horner(&octave.oil, -0.5);
            let [h0, ..] = &mut octave.oil;
            *h0 = from_start;
            h_mpa = horner(&octave.oil, 0.5);
            octave_mpa *= 2.0;
        }
    }

    /// Compression loss `chi = 1 - rho_L/rho_H` of oil compressed from `low` to `high` at temperature `oil`: the
    /// fraction of its volume that is lost.
    ///
    /// Pressures are clamped to [`MIN_PRESSURE_MPA_ABS`]..[`MAX_PRESSURE_MPA_ABS`]. For `low` above `high` the result
    /// is negative.
    #[doc(alias = "Wylie")]
    #[doc(alias = "density ratio")]
    #[inline(always)]
    #[must_use]
    pub fn compression_loss(&self, low: MegapascalAbs, high: MegapascalAbs, oil: Celsius) -> f32 {
        let (air_low, oil_low_mpa) = self.air_and_oil(low);
        let (air_high, oil_high_mpa) = self.air_and_oil(high);
        let y = (air_low - air_high) + (oil_high_mpa - oil_low_mpa) * self.slope_per_mpa(oil);
        // 1 - exp(-y): five terms leave y^6/720, 1e-9 at y = 0.1 (50 MPa on a soft oil).
        y * (1.0
            - y * (1.0 / 2.0) * (1.0 - y * (1.0 / 3.0) * (1.0 - y * (1.0 / 4.0) * (1.0 - y * (1.0 / 5.0)))))
    }

    /// Compressibility of the oil without air, `1/beta_0(T)`, in 1/MPa: slope of the compression loss with the higher
    /// pressure.
    #[inline(always)]
    #[must_use]
    pub(crate) fn slope_per_mpa(&self, oil: Celsius) -> f32 {
        self.per_bulk_modulus / self.softening(oil)
    }

    /// Relative change of the bulk modulus per kelvin, negative for real oils. That of the compression loss is its
    /// opposite, to within the few per cent by which the modulus differs from that at the reference temperature.
    #[inline(always)]
    #[must_use]
    pub(crate) fn softening_per_k(&self) -> f32 {
        self.bulk_modulus_per_k
    }

    /// Bulk modulus at a temperature over that at the reference temperature.
    #[inline(always)]
    fn softening(&self, oil: Celsius) -> f32 {
        1.0 + self.bulk_modulus_per_k * (oil.get() - self.reference_c)
    }

    /// `a(p)` and, in MPa, `h(p)`.
    #[inline(always)]
    fn air_and_oil(&self, p: MegapascalAbs) -> (f32, f32) {
        let p_mpa = p.get().clamp(MIN_PRESSURE_MPA_ABS, MAX_PRESSURE_MPA_ABS - 1e-5);
        let bits = p_mpa.to_bits();
        let index = (bits >> 23).wrapping_sub(FIRST_EXPONENT) as usize;
        let s = f32::from_bits((bits & 0x007f_ffff) | 0x3f80_0000) - 1.5;
        match self.octaves.get(index) {
            Some(octave) => (horner(&octave.air, s), horner(&octave.oil, s)),
            // Reached after the clamp by NaN only, which must stay NaN.
            None => (f32::NAN, f32::NAN),
        }
    }
}

/// Relative air volume `x = (p_0/p)^(1/lambda)` (polytropic): volume over that at a standard atmosphere.
fn air_ratio(p_mpa_abs: f32, heat_capacity_ratio: f32) -> f32 {
    libm::powf(STANDARD_ATMOSPHERE_MPA / p_mpa_abs, 1.0 / heat_capacity_ratio)
}

/// Polynomial with `coefficients` in ascending order, by Horner's scheme.
#[inline(always)]
fn horner<const N: usize>(coefficients: &[f32; N], s: f32) -> f32 {
    coefficients.iter().rev().fold(0.0, |sum, k| sum * s + k)
}

/// Coefficients of the polynomial through `values` at [`NODE_AT`] (Newton's divided differences, then expanded).
fn interpolate(values: [f32; NODES]) -> [f32; NODES] {
    let mut differences = values;
    for order in 1..NODES {
        let lower = differences;
        for (i, difference) in differences.iter_mut().enumerate().skip(order) {
            let (Some(right), Some(left)) = (lower.get(i), lower.get(i - 1)) else { continue };
            let (Some(x_right), Some(x_left)) = (NODE_AT.get(i), NODE_AT.get(i - order)) else { continue };
            *difference = (right - left) / (x_right - x_left);
        }
    }
    let mut polynomial = [0.0; NODES];
    // Each side reversed by itself: reversing their zip adds a panic path for unequal lengths.
    for (node, difference) in NODE_AT.iter().rev().zip(differences.iter().rev()) {
        // polynomial = polynomial*(s - node) + difference
        let mut carry = 0.0;
        for k in &mut polynomial {
            let shifted = carry;
            carry = *k;
            *k = shifted - node * *k;
        }
        let [constant, ..] = &mut polynomial;
        *constant += difference;
    }
    polynomial
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interpolation_returns_a_quintic_exactly() {
        let wanted = [1.0, -2.0, 3.0, -4.0, 5.0, -6.0];
        for (got, wanted) in interpolate(NODE_AT.map(|s| horner(&wanted, s))).iter().zip(wanted) {
            // Rounding of f32 values of order 1 through six divided differences over gaps down to 0.13.
            assert!((got - wanted).abs() < 5e-4, "{got} {wanted}");
        }
    }
}
