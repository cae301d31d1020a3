//! Equation of state of the oil: pressure from density, by Wylie's bulk modulus and a smooth cavitation branch.
//!
//! The model stores mass, so it needs pressure from density, monotone down to an empty chamber. Wylie's bulk modulus of
//! oil with free air (Wylie and Streeter 1993; paper eq. 2; p absolute)
//!
//! ```text
//! x = (p_0/p)^(1/lambda)
//! beta = beta_0 * (1 + c*x) / (1 + c*x*beta_0/(lambda*p))          d ln(rho) = dp / beta
//! ```
//!
//! is integrated once into a table over equal steps of density (cubic Hermite, its slopes exact), because a power in
//! every evaluation would cost more than the rest of the model. Below `p_t`, 0.02 MPa above vapour pressure, oil
//! becomes a mixture with vapour: p = p_v + (p_t - p_v)/(1 + y + y^2/2), y = (rho_t - rho)/rho_t * beta_t/(p_t - p_v),
//! which continues value and slope and tends to vapour pressure as the chamber empties.
//!
//! Limits: air neither dissolves nor comes out; the mixture has one pressure and no inertia of bubbles.

use crate::invalid_input::InvalidInput;
use crate::machine::OilProperties;
use crate::value_range::ValueRange;

use crate::simd::{F64x4, WIDTH};

/// Standard atmosphere p_0.
pub const ATMOSPHERE_PA: f64 = 101_325.0;
/// Temperatures at which oil properties are extrapolated linearly without losing their meaning.
pub const TEMPERATURE: ValueRange = ValueRange::new(-40.0, 150.0, "degC");
/// Upper end of the table, absolute; three times the highest pressure of the paper's tests.
pub const MAX_PRESSURE_PA: f64 = 160.0e6;
/// Start of the cavitation branch above vapour pressure.
const TRANSITION_ABOVE_VAPOUR_PA: f64 = 0.02e6;
/// Cells of the table. With 4096 the relative error of pressure is below 1e-6 from 0.1 MPa absolute upwards (tested).
const CELLS: usize = 4096;
/// Just short of the last cell's far end.
const LAST_CELL: f64 = CELLS as f64 - 0.51;
/// 2^52: added to a small positive number, it leaves the nearest integer in the low bits.
const ROUNDING: f64 = 4_503_599_627_370_496.0;

/// Oil at one temperature, tabulated over density.
#[derive(Debug, Clone)]
pub struct OilTable {
    density_kg_m3: f64,
    beta_0_pa: f64,
    air_fraction: f64,
    heat_capacity_ratio: f64,
    kinematic_viscosity_mm2_s: f64,
    vapour_pa: f64,
    transition_pa: f64,
    rho_t: f64,
    cavitation_slope: f64,
    inv_cell: f64,
    /// Cubics about integer multiples of the cell's width above the transition density.
    cell: Box<[[f64; 4]; CELLS]>,
}

impl OilTable {
    /// Tabulates the oil at temperature `t_c`.
    ///
    /// # Errors
    /// When the temperature is outside its range or makes a property vanish.
    pub fn new(oil: &OilProperties, t_c: f64) -> Result<Self, InvalidInput> {
        if !TEMPERATURE.contains(t_c) {
            return Err(InvalidInput::new("oil temperature is out of range")
                .with_value(t_c)
                .with_allowed(TEMPERATURE));
        }
        let warmer_k = t_c - oil.reference_c;
        let beta_factor = 1.0 + oil.bulk_modulus_per_k * warmer_k;
        let density_factor = 1.0 + oil.density_per_k * warmer_k;
        // A quarter of the reference value is already far outside any oil's data sheet.
        if beta_factor < 0.25 || density_factor < 0.25 {
            return Err(InvalidInput::new(
                "oil temperature is so far from oil.reference_c that bulk modulus or density nearly vanish",
            )
            .with_value(t_c));
        }
        let vapour_pa = oil.vapour_pressure_mpa_abs * 1.0e6;
        let mut table = Self {
            density_kg_m3: oil.density_kg_m3 * density_factor,
            beta_0_pa: oil.bulk_modulus_mpa * 1.0e6 * beta_factor,
            air_fraction: oil.air_fraction,
            heat_capacity_ratio: oil.heat_capacity_ratio,
            kinematic_viscosity_mm2_s: viscosity(oil, t_c),
            vapour_pa,
            transition_pa: vapour_pa + TRANSITION_ABOVE_VAPOUR_PA,
            rho_t: 0.0,
            cavitation_slope: 0.0,
            inv_cell: 0.0,
            cell: Box::new([[0.0; 4]; CELLS]),
        };
        table.fill();
        Ok(table)
    }

    /// Effective bulk modulus of oil with free air at an absolute pressure (Wylie and Streeter 1993; paper eq. 2).
    #[doc(alias = "Wylie")]
    #[doc(alias = "effective bulk modulus")]
    #[must_use]
    pub fn bulk_modulus_pa(&self, p_abs_pa: f64) -> f64 {
        let c_x = self.air_fraction * (ATMOSPHERE_PA / p_abs_pa).powf(1.0 / self.heat_capacity_ratio);
        self.beta_0_pa * (1.0 + c_x) / (1.0 + c_x * self.beta_0_pa / (self.heat_capacity_ratio * p_abs_pa))
    }

    /// Density at the standard atmosphere.
    #[must_use]
    pub fn density_kg_m3(&self) -> f64 {
        self.density_kg_m3
    }

    /// Kinematic viscosity by Walther's law (Walther 1931; ASTM D341).
    #[doc(alias = "Walther")]
    #[must_use]
    pub fn kinematic_viscosity_mm2_s(&self) -> f64 {
        self.kinematic_viscosity_mm2_s
    }

    /// Vapour pressure, absolute.
    #[must_use]
    pub fn vapour_pa(&self) -> f64 {
        self.vapour_pa
    }

    /// Pressure (absolute) and its derivative with respect to density.
    #[inline(always)]
    #[must_use]
    pub fn pressure(&self, rho: f64) -> (f64, f64) {
        let x = (rho - self.rho_t) * self.inv_cell;
        if x < 0.0 {
            return self.cavitating(x);
        }
        let nearest = x.min(LAST_CELL) + ROUNDING;
        let [c0, c1, c2, c3] = self.cell[nearest.to_bits() as usize % CELLS];
        let t = x - (nearest - ROUNDING);
        (c0 + t * (c1 + t * (c2 + t * c3)), (c1 + t * ((c2 + c2) + t * (3.0 * c3))) * self.inv_cell)
    }

    /// [`OilTable::pressure`] of four lanes.
    #[inline(always)]
    #[must_use]
    pub fn pressure4(&self, rho: F64x4) -> (F64x4, F64x4) {
        let x = (rho - F64x4::all(self.rho_t)) * F64x4::all(self.inv_cell);
        let rounding = F64x4::all(ROUNDING);
        let nearest = x.min(F64x4::all(LAST_CELL)).max(F64x4::ZERO) + rounding;
        let t = x - (nearest - rounding);
        let mut c = [F64x4::ZERO; 4];
        for l in 0..WIDTH {
            let cell = &self.cell[nearest.0[l].to_bits() as usize % CELLS];
            for (c, x) in c.iter_mut().zip(cell) {
                c.0[l] = *x;
            }
        }
        let [c0, c1, c2, c3] = c;
        let mut p = c0 + t * (c1 + t * (c2 + t * c3));
        let mut slope = (c1 + t * ((c2 + c2) + t * (F64x4::all(3.0) * c3))) * F64x4::all(self.inv_cell);
        if x.smallest() < 0.0 {
            for l in 0..WIDTH {
                if x.0[l] < 0.0 {
                    (p.0[l], slope.0[l]) = self.cavitating(x.0[l]);
                }
            }
        }
        (p, slope)
    }

    /// Cavitating mixture, `x` cells below the transition.
    #[inline(never)]
    fn cavitating(&self, x: f64) -> (f64, f64) {
        let y = -x * self.cavitation_slope;
        let above = self.transition_pa - self.vapour_pa;
        let inv = 1.0 / (1.0 + y + 0.5 * y * y);
        (self.vapour_pa + above * inv, above * (1.0 + y) * inv * inv * self.cavitation_slope * self.inv_cell)
    }

    /// Density at an absolute pressure, by bisection and Newton's method on the table; for start values only.
    #[must_use]
    pub fn density_at(&self, p_abs_pa: f64) -> f64 {
        let (mut low, mut high) = (0.0, self.rho_t + LAST_CELL / self.inv_cell);
        let mut rho = self.density_kg_m3;
        for _ in 0..200 {
            let (p, slope) = self.pressure(rho);
            if p > p_abs_pa {
                high = rho;
            } else {
                low = rho;
            }
            let newton = rho - (p - p_abs_pa) / slope.max(1.0e-9);
            let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
            if (next - rho).abs() < 1.0e-13 * self.density_kg_m3 {
                return next;
            }
            rho = next;
        }
        rho
    }

    /// Integrates dp/drho = beta(p)/rho upwards from the transition, one cell at a time.
    fn fill(&mut self) {
        let beta_t = self.bulk_modulus_pa(self.transition_pa);
        self.rho_t = self.density_kg_m3 * (-self.log_density(self.transition_pa, ATMOSPHERE_PA)).exp();
        let rho_max = self.density_kg_m3 * self.log_density(ATMOSPHERE_PA, MAX_PRESSURE_PA).exp();
        let width = (rho_max - self.rho_t) / (CELLS as f64 - 1.0);
        self.inv_cell = 1.0 / width;
        self.cavitation_slope = width / self.rho_t * beta_t / (self.transition_pa - self.vapour_pa);
        // Cell k reaches from k - 1/2 to k + 1/2; the first one only upwards, so its cubic is taken from its upper
        // half.
        let mut p = self.transition_pa;
        for k in 0..CELLS {
            let (left, right) = (if k == 0 { 0.0 } else { k as f64 - 0.5 }, k as f64 + 0.5);
            let (rho, rho_right) = (self.rho_t + left * width, self.rho_t + right * width);
            // The first cells hold the steep end of the air's law; the rest is nearly linear.
            let q = self.integrate(p, rho, rho_right, if k < 64 { 8 } else { 1 });
            let wide = right - left;
            let d0 = self.bulk_modulus_pa(p) / rho * width * wide;
            let d1 = self.bulk_modulus_pa(q) / rho_right * width * wide;
            // Hermite cubic in s = (x - left)/wide, then moved to t = x - k = wide*s + left - k.
            let (a2, a3) = (3.0 * (q - p) - 2.0 * d0 - d1, 2.0 * (p - q) + d0 + d1);
            let (b1, b2, b3) = (d0 / wide, a2 / (wide * wide), a3 / (wide * wide * wide));
            let m = k as f64 - left;
            self.cell[k] =
                [p + m * (b1 + m * (b2 + m * b3)), b1 + m * (2.0 * b2 + 3.0 * m * b3), b2 + 3.0 * m * b3, b3];
            p = q;
        }
    }

    /// Pressure at `rho_to`, from `p` at `rho_from`: classical Runge-Kutta in `parts` steps.
    fn integrate(&self, p: f64, rho_from: f64, rho_to: f64, parts: u32) -> f64 {
        let h = (rho_to - rho_from) / f64::from(parts);
        (0..parts).fold(p, |q, part| {
            let r = rho_from + f64::from(part) * h;
            let k1 = self.bulk_modulus_pa(q) / r;
            let k2 = self.bulk_modulus_pa(q + 0.5 * h * k1) / (r + 0.5 * h);
            let k3 = self.bulk_modulus_pa(q + 0.5 * h * k2) / (r + 0.5 * h);
            let k4 = self.bulk_modulus_pa(q + h * k3) / (r + h);
            q + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        })
    }

    /// ln(rho(b)/rho(a)): Simpson's rule over equal steps of ln p, in which the air's law is smooth.
    fn log_density(&self, a_pa: f64, b_pa: f64) -> f64 {
        const INTERVALS: usize = 400;
        let step = (b_pa / a_pa).ln() / INTERVALS as f64;
        let f = |k: usize| {
            let p = a_pa * (step * k as f64).exp();
            p / self.bulk_modulus_pa(p)
        };
        let inner: f64 = (1..INTERVALS).map(|k| if k % 2 == 1 { 4.0 * f(k) } else { 2.0 * f(k) }).sum();
        step / 3.0 * (f(0) + inner + f(INTERVALS))
    }
}

/// Walther: log10 log10(nu + 0.7) = A - B log10(T/K).
fn viscosity(oil: &OilProperties, t_c: f64) -> f64 {
    let w = oil.walther_a - oil.walther_b * (t_c + 273.15).log10();
    10f64.powf(10f64.powf(w)) - 0.7
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::Machine;

    fn table(t_c: f64) -> OilTable {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../machines/reference.toml");
        OilTable::new(Machine::load(&path).unwrap().oil(), t_c).unwrap()
    }

    /// ln(rho/rho_0) = ln((1 + c)/(1 + c x)) + 1/beta_0 * integral of dp/(1 + c x), by the midpoint rule in ln p.
    fn log_density(oil: &OilTable, p: f64) -> f64 {
        let x = |p: f64| (ATMOSPHERE_PA / p).powf(1.0 / oil.heat_capacity_ratio);
        let n = 20_000;
        let step = (p / ATMOSPHERE_PA).ln() / f64::from(n);
        let integral: f64 = (0..n)
            .map(|k| {
                let at = ATMOSPHERE_PA * (step * (f64::from(k) + 0.5)).exp();
                at * step / (1.0 + oil.air_fraction * x(at))
            })
            .sum();
        ((1.0 + oil.air_fraction) / (1.0 + oil.air_fraction * x(p))).ln() + integral / oil.beta_0_pa
    }

    /// 1e-6 of pressure is 1e-8 of ratio; the midpoint rule's own error is below that.
    #[test]
    fn val_table_agrees_with_wylies_law_integrated_independently() {
        let oil = table(60.0);
        for p_mpa in [0.1013, 0.2, 0.5, 1.6, 5.0, 20.0, 36.6, 60.0, 120.0] {
            let rho = oil.density_kg_m3() * log_density(&oil, p_mpa * 1e6).exp();
            let (p, slope) = oil.pressure(rho);
            assert!((p / (p_mpa * 1e6) - 1.0).abs() < 1e-6, "{p_mpa} MPa: {p}");
            assert!((slope * rho / oil.bulk_modulus_pa(p) - 1.0).abs() < 1e-4, "{p_mpa} MPa: slope");
        }
    }

    #[test]
    fn prop_pressure_rises_with_density_and_never_falls_below_vapour_pressure() {
        let oil = table(60.0);
        let mut last = 0.0;
        for k in 0..200_000 {
            let rho = 1000.0 * f64::from(k) / 200_000.0;
            let (p, slope) = oil.pressure(rho);
            assert!(
                p >= oil.vapour_pa() && p >= last && slope >= 0.0,
                "density {rho}: {p} Pa after {last} Pa"
            );
            last = p;
        }
    }

    #[test]
    fn prop_four_lanes_give_the_bits_of_one() {
        let oil = table(60.0);
        for k in 0..5000 {
            let rho = F64x4([0, 1, 2, 3].map(|l| 780.0 + 0.05 * f64::from(k) + 0.01 * f64::from(l)));
            let (p, slope) = oil.pressure4(rho);
            for l in 0..WIDTH {
                assert_eq!((p.0[l], slope.0[l]), oil.pressure(rho.0[l]));
            }
        }
    }

    #[test]
    fn prop_density_at_inverts_pressure() {
        let oil = table(60.0);
        for p in [600.0, 5.0e3, 2.0e4, 1.0e5, 1.6e6, 5.0e7, 1.5e8] {
            // Rounding of density is 1e-13 of it, times bulk modulus over pressure at the stiff end.
            assert!((oil.pressure(oil.density_at(p)).0 / p - 1.0).abs() < 1e-6, "{p}");
        }
    }

    #[test]
    fn val_paper_viscosity_at_30_and_90_degrees() {
        for (t, published) in [(30.0, 88.3), (90.0, 20.8)] {
            // The paper gives one decimal.
            assert!((table(t).kinematic_viscosity_mm2_s() - published).abs() < 0.1);
        }
    }

    #[test]
    fn temperature_out_of_range_is_rejected() {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../machines/reference.toml");
        let machine = Machine::load(&path).unwrap();
        for t in [-300.0, 500.0, f64::NAN] {
            assert!(OilTable::new(machine.oil(), t).unwrap_err().to_string().contains("temperature"));
        }
    }
}
