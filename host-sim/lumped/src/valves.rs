//! Flow laws of orifices and valves: mass flow and its derivatives with respect to both pressures.
//!
//! Orifice, with K = C_d A sqrt(2 rho), rho the density upstream, d the laminar transition `LAMINAR_PA`:
//!
//! ```text
//! K = k (1 + rho/rho_0),   k = C_d A sqrt(2 rho_0)/2      conductance
//! ```
//!
//! (the square root of the density linearised about rho_0: 3e-4 off at the ends of the liquid range), and
//!
//! ```text
//! q = dp / sqrt(s),   s = d/2 + sqrt(d^2/4 + dp^2)        flow   m' = K q
//! dp = q sqrt(q^2 + d)                                    its inverse
//! ```
//!
//! turbulent (square root) for |dp| far above d, laminar (linear) near zero, smooth, and in closed form both ways.
//! Valves are quasi-static: their own spool or poppet dynamics (a few ms and faster) are not modelled.

use crate::machine::{OpeningValve, ReliefValve};

/// Pressure difference of the laminar transition: 5 kPa, where a port's Reynolds number is of the order of 1000.
pub const LAMINAR_PA: f64 = 5.0e3;
/// Discharge coefficient of the circuit's valves.
const VALVE_CD: f64 = 0.7;
/// Fraction of the override over which a relief valve's onset is rounded, so that Newton's method sees no corner.
const RELIEF_ROUNDING: f64 = 0.1;

/// Mass flow with its derivatives with respect to the pressures upstream (`from`) and downstream (`to`).
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct MassFlow {
    /// Mass flow from `from` to `to`, kg/s.
    pub kg_s: f64,
    /// Derivative with respect to the pressure at `from`.
    pub d_from: f64,
    /// Derivative with respect to the pressure at `to`.
    pub d_to: f64,
}

/// Conductance k = C_d A sqrt(2 rho_0)/2 of an orifice in oil of density `rho_0`.
#[must_use]
pub fn conductance(discharge_coefficient: f64, area_mm2: f64, rho_0: f64) -> f64 {
    discharge_coefficient * area_mm2 * 1.0e-6 * 0.5 * (2.0 * rho_0).sqrt()
}

/// Orifice law: flow of a conductance between pressures `p_from` and `p_to`; densities of both sides relative to rho_0.
#[inline(always)]
#[must_use]
pub fn orifice(conductance: f64, p_from: f64, p_to: f64, rho_from: f64, rho_to: f64) -> MassFlow {
    let dp = p_from - p_to;
    let w = (0.25 * LAMINAR_PA * LAMINAR_PA + dp * dp).sqrt();
    let root = (0.5 * LAMINAR_PA + w).sqrt();
    let rho = if dp > 0.0 { rho_from } else { rho_to };
    let k = conductance * (1.0 + rho);
    let slope = k * root / (2.0 * w);
    MassFlow { kg_s: k * dp / root, d_from: slope, d_to: -slope }
}

/// Relief valve: flow proportional to the pressure above cracking.
#[derive(Debug, Clone, Copy)]
pub struct ReliefLaw {
    crack_pa: f64,
    rounding_pa: f64,
    kg_s_per_pa: f64,
}

impl ReliefLaw {
    /// Law of a relief valve in oil of density `rho`.
    #[must_use]
    pub fn new(valve: &ReliefValve, rho: f64) -> Self {
        let override_pa = valve.override_mpa * 1.0e6;
        Self {
            crack_pa: valve.setting_mpa * 1.0e6 - override_pa,
            rounding_pa: RELIEF_ROUNDING * override_pa,
            kg_s_per_pa: rho * valve.rated_flow_l_min
                / 60_000.0
                / (override_pa * (1.0 - 0.5 * RELIEF_ROUNDING)),
        }
    }

    /// Flow at pressures `p_from`, `p_to`; never reversed.
    #[inline(always)]
    #[must_use]
    pub fn flow(&self, p_from: f64, p_to: f64) -> MassFlow {
        let above = p_from - p_to - self.crack_pa;
        if above <= 0.0 {
            return MassFlow::default();
        }
        let (y, slope) = if above < self.rounding_pa {
            (0.5 * above * above / self.rounding_pa, above / self.rounding_pa)
        } else {
            (above - 0.5 * self.rounding_pa, 1.0)
        };
        let d = self.kg_s_per_pa * slope;
        MassFlow { kg_s: self.kg_s_per_pa * y, d_from: d, d_to: -d }
    }
}

/// Smooth step from 0 at `start` to 1 at `end`, with its derivative.
#[inline(always)]
fn smooth_step(x: f64, start: f64, end: f64) -> (f64, f64) {
    let inv = 1.0 / (end - start);
    let t = ((x - start) * inv).clamp(0.0, 1.0);
    (t * t * (3.0 - 2.0 * t), 6.0 * t * (1.0 - t) * inv)
}

/// Orifice whose area opens smoothly with a pressure difference.
#[derive(Debug, Clone, Copy)]
struct VariableOrifice {
    crack_pa: f64,
    full_open_pa: f64,
    conductance: f64,
}

impl VariableOrifice {
    fn new(valve: &OpeningValve, rho_0: f64) -> Self {
        Self {
            crack_pa: valve.crack_mpa * 1.0e6,
            full_open_pa: valve.full_open_mpa * 1.0e6,
            conductance: conductance(VALVE_CD, valve.area_mm2, rho_0),
        }
    }

    /// Fraction of the full area at an opening pressure difference, with its derivative.
    #[inline(always)]
    fn opening(&self, dp: f64) -> (f64, f64) {
        smooth_step(dp, self.crack_pa, self.full_open_pa)
    }
}

/// Check valve: orifice whose area opens with the pressure difference.
#[derive(Debug, Clone, Copy)]
pub struct CheckLaw(VariableOrifice);

impl CheckLaw {
    /// Law of a check valve in oil of density `rho_0`.
    #[must_use]
    pub fn new(valve: &OpeningValve, rho_0: f64) -> Self {
        Self(VariableOrifice::new(valve, rho_0))
    }

    /// Flow at pressures `p_from`, `p_to`; never reversed.
    #[inline(always)]
    #[must_use]
    pub fn flow(&self, p_from: f64, p_to: f64, rho_from: f64) -> MassFlow {
        let (open, d_open) = self.0.opening(p_from - p_to);
        if open <= 0.0 {
            return MassFlow::default();
        }
        let full = orifice(self.0.conductance, p_from, p_to, rho_from, rho_from);
        let d = full.d_from * open + full.kg_s * d_open;
        MassFlow { kg_s: full.kg_s * open, d_from: d, d_to: -d }
    }
}

/// Shuttle valve: orifice from the lower line, opened by the difference of the lines.
#[derive(Debug, Clone, Copy)]
pub struct ShuttleLaw(VariableOrifice);

impl ShuttleLaw {
    /// Law of a shuttle valve in oil of density `rho_0`.
    #[must_use]
    pub fn new(valve: &OpeningValve, rho_0: f64) -> Self {
        Self(VariableOrifice::new(valve, rho_0))
    }

    /// Flow of one side, from the line at `p_line` to the flushing gallery at `p_to`, opened by `p_other - p_line`.
    ///
    /// `d_from` is the derivative with respect to the own line's pressure, the second value that with respect to the
    /// other line's.
    #[inline(always)]
    #[must_use]
    pub fn flow(&self, p_line: f64, p_other: f64, p_to: f64, rho: (f64, f64)) -> (MassFlow, f64) {
        let (open, d_open) = self.0.opening(p_other - p_line);
        if open <= 0.0 {
            return (MassFlow::default(), 0.0);
        }
        let full = orifice(self.0.conductance, p_line, p_to, rho.0, rho.1);
        let by_spool = full.kg_s * d_open;
        (
            MassFlow {
                kg_s: full.kg_s * open,
                d_from: full.d_from * open - by_spool,
                d_to: full.d_to * open,
            },
            by_spool,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::Machine;

    /// Central differences of 1 Pa against the stated slopes; 1e-4: curvature near the laminar transition.
    fn check_slopes(flow: impl Fn(f64, f64) -> MassFlow, p: f64, q: f64) {
        let by_from = (flow(p + 1.0, q).kg_s - flow(p - 1.0, q).kg_s) / 2.0;
        let by_to = (flow(p, q + 1.0).kg_s - flow(p, q - 1.0).kg_s) / 2.0;
        let at = flow(p, q);
        let scale = 1e-4 * at.d_from.abs().max(1e-12);
        assert!((at.d_from - by_from).abs() <= scale, "{p} {q}: {} {by_from}", at.d_from);
        assert!((at.d_to - by_to).abs() <= scale, "{p} {q}: {} {by_to}", at.d_to);
    }

    #[test]
    fn prop_slopes_are_the_derivatives_of_the_flows() {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../machines/seven-piston.toml");
        let machine = Machine::load(&path).unwrap();
        let dynamics = machine.circuit().dynamics.as_ref().unwrap();
        let relief = ReliefLaw::new(&dynamics.charge_relief, 860.0);
        let check = CheckLaw::new(&dynamics.check_valve, 860.0);
        let shuttle = ShuttleLaw::new(&dynamics.shuttle, 860.0);
        for k in 0..400 {
            let dp = -4.0e6 + 2.0e4 * f64::from(k) + 37.0;
            check_slopes(|p, q| orifice(1.0e-3, p, q, 1.0, 1.0), 5.0e6 + dp, 5.0e6);
            check_slopes(|p, q| relief.flow(p, q), 5.0e6 + dp, 5.0e6);
            check_slopes(|p, q| check.flow(p, q, 1.0), 5.0e6 + dp, 5.0e6);
            check_slopes(|p, q| shuttle.flow(p, 2.9e6, q, (1.0, 1.0)).0, 2.0e6 + 0.1 * dp, 1.9e6);
        }
    }

    #[test]
    fn val_orifice_is_turbulent_far_from_zero_and_its_inverse_returns_the_drop() {
        let k = conductance(0.7, 100.0, 860.0);
        // C_d A sqrt(2 rho dp) at 10 MPa; the laminar transition of 5 kPa leaves 1.3e-4.
        let ideal = 0.7 * 100.0e-6 * (2.0 * 860.0 * 10.0e6f64).sqrt();
        assert!((orifice(k, 10.0e6, 0.0, 1.0, 1.0).kg_s / ideal - 1.0).abs() < 2e-4);
        for dp in [-3.0e7, -1.0e4, 10.0, 2.0e3, 5.0e5] {
            let q = orifice(k, dp, 0.0, 1.0, 1.0).kg_s / (2.0 * k);
            assert!((q * (q * q + LAMINAR_PA).sqrt() / dp - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn relief_and_check_valves_never_pass_oil_backwards() {
        let relief = ReliefValve { setting_mpa: 2.0, rated_flow_l_min: 100.0, override_mpa: 0.2 };
        let law = ReliefLaw::new(&relief, 860.0);
        assert_eq!(law.flow(1.0e6, 0.0), MassFlow::default());
        assert_eq!(law.flow(0.0, 5.0e6), MassFlow::default());
        // At its setting it passes its rated flow.
        let flow = law.flow(2.0e6, 0.0).kg_s / 860.0 * 60_000.0;
        assert!((flow - 100.0).abs() < 1e-9, "{flow}");
    }
}
