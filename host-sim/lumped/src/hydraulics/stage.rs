//! One implicit stage: volumes, port areas and first guess at an instant, and the work space of Newton's method.

use crate::layout::{GROUPS, LANES, LINE_A, LINE_B, NODES};
use crate::plant::Plant;
use crate::simd::{F64x4, WIDTH};

use super::masses::Masses;

/// Bulk modulus by which the first guess separates stiff ports from soft ones; its exact value affects iterations only.
const STIFF_BETA_PA: f64 = 1.2e9;

/// Four chambers at one instant: geometry, current iterate, linearised flows.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct ChamberGroup {
    pub(super) phi: F64x4,
    pub(super) volume: F64x4,
    pub(super) inv_v: F64x4,
    /// dV/dt.
    pub(super) v_rate: F64x4,
    /// Conductance of the wider port; `main_a` is 1 where that port leads to line A.
    pub(super) area_1: F64x4,
    pub(super) main_a: F64x4,
    /// Conductance of the other port: positive only where a chamber bridges both kidneys.
    pub(super) area_2: F64x4,
    /// Weights in the vector sums of lines A and B; 0 for a bridging chamber, which is eliminated separately.
    pub(super) weight_a: F64x4,
    pub(super) weight_b: F64x4,
    pub(super) rho: F64x4,
    pub(super) p: F64x4,
    pub(super) slope: F64x4,
    /// Square root of the pressure drop that corresponds to the main port's flow; `soft` is 1 where the flow is
    /// linearised at the pressure drop, 0 where at the flow (stiff).
    pub(super) q: F64x4,
    pub(super) soft: F64x4,
    pub(super) any_soft: bool,
    pub(super) q_slope: F64x4,
    pub(super) q_miss: F64x4,
    pub(super) f: F64x4,
    pub(super) d_own: F64x4,
    pub(super) d_node: F64x4,
    pub(super) leak: F64x4,
    pub(super) d_leak: F64x4,
    pub(super) residual: F64x4,
    pub(super) inv_diag: F64x4,
    pub(super) change: F64x4,
}

/// Narrower port of a chamber that bridges both kidneys.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct BridgePort {
    pub(super) lane: usize,
    pub(super) other: usize,
    pub(super) f: f64,
    pub(super) d_own: f64,
    pub(super) d_node: f64,
}

/// Implicit stage of the integrator: volumes and port areas at one instant, and the work space of Newton's method.
#[derive(Debug, Clone)]
pub struct ImplicitStage {
    /// Current iterate; the solution after convergence.
    pub m: Masses,
    /// Absolute pressures of the nodes.
    pub p_node: [f64; NODES],
    pub(super) group: [ChamberGroup; GROUPS],
    pub(super) bridges: [BridgePort; LANES],
    pub(super) bridge_count: usize,
    /// Newton iterations so far, for statistics.
    pub iterations: u64,
}

impl Default for ImplicitStage {
    fn default() -> Self {
        Self {
            m: Masses::default(),
            p_node: [0.0; NODES],
            group: [ChamberGroup::default(); GROUPS],
            bridges: [BridgePort::default(); LANES],
            bridge_count: 0,
            iterations: 0,
        }
    }
}

/// Angles and speeds of the shafts and the displacement fraction at one instant.
#[derive(Debug, Clone, Copy)]
pub struct Kinematics {
    /// Pump angle in [0, 2 pi).
    pub phi_p: f64,
    /// Motor angle in [0, 2 pi).
    pub phi_m: f64,
    /// Pump speed.
    pub omega_p: f64,
    /// Motor speed.
    pub omega_m: f64,
    /// Displacement fraction.
    pub alpha: f64,
}

impl ImplicitStage {
    /// Volume of one chamber at the placed instant.
    #[must_use]
    pub fn volume_m3(&self, lane: usize) -> f64 {
        self.group[lane / WIDTH].volume.0[lane % WIDTH]
    }

    /// Conductance of one chamber's ports to line A and to line B at the placed instant.
    #[must_use]
    pub fn conductance(&self, lane: usize) -> (f64, f64) {
        let (g, l) = (&self.group[lane / WIDTH], lane % WIDTH);
        let (wide, narrow) = (g.area_1.0[l], g.area_2.0[l]);
        if g.main_a.0[l] > 0.5 { (wide, narrow) } else { (narrow, wide) }
    }

    /// Absolute pressures of the chambers after a solution.
    #[inline(always)]
    #[must_use]
    pub fn pressures(&self) -> [F64x4; GROUPS] {
        std::array::from_fn(|g| self.group[g].p)
    }

    /// Whether a chamber belongs to line A: by its wider port, or by the half revolution when both ports are shut.
    #[must_use]
    pub fn nearer_to_a(&self, lane: usize, pump: bool) -> bool {
        let (g, l) = (&self.group[lane / WIDTH], lane % WIDTH);
        if g.area_1.0[l] > 0.0 {
            return g.main_a.0[l] > 0.5;
        }
        (g.phi.0[l] < std::f64::consts::PI) != pump
    }

    /// Places the chambers: computes volumes and port areas at one instant.
    ///
    /// V = V_0 + V_s/2 * (1 - alpha*cos(phi)); the motor's alpha is 1.
    #[inline(always)]
    pub fn place(&mut self, plant: &Plant, at: &Kinematics) {
        let (sin_p, cos_p) = at.phi_p.sin_cos();
        let (sin_m, cos_m) = at.phi_m.sin_cos();
        let (half, one, tau) = (F64x4::all(0.5), F64x4::all(1.0), F64x4::all(std::f64::consts::TAU));
        self.bridge_count = 0;
        for g in 0..plant.groups.min(GROUPS) {
            let group = &mut self.group[g];
            let pick =
                |pump: f64, motor: f64| plant.is_pump[g].if_above(half, F64x4::all(pump), F64x4::all(motor));
            let turned = pick(at.phi_p, at.phi_m) + plant.offset_rad[g];
            let phi = turned - turned.if_above(tau, tau, F64x4::ZERO);
            let (sin, cos) = (pick(sin_p, sin_m), pick(cos_p, cos_m));
            let sin_i = sin * plant.cos_offset[g] + cos * plant.sin_offset[g];
            let cos_i = cos * plant.cos_offset[g] - sin * plant.sin_offset[g];
            let alpha = pick(at.alpha, 1.0);
            let half_stroke = plant.half_stroke_m3[g];
            group.phi = phi;
            group.volume = plant.dead_m3[g] + half_stroke * (one - alpha * cos_i);
            group.inv_v = one / group.volume;
            let v_rate = half_stroke * alpha * sin_i * pick(at.omega_p, at.omega_m);
            let (mut a, mut b) = plant.ports[g].conductance(phi);
            if plant.pump_table.is_some() || plant.motor_table.is_some() {
                plant.table_areas(g, &phi, &mut a, &mut b);
            }
            let main_a = b.if_above(a, F64x4::ZERO, one);
            // The flow through a port that stays the same changes by the piston's own flow; a new port starts with it.
            let same = F64x4::all(0.1).if_above((main_a - group.main_a).abs(), one, F64x4::ZERO);
            group.f = same * (group.f + group.rho * group.v_rate) - group.rho * v_rate;
            group.v_rate = v_rate;
            group.main_a = main_a;
            group.area_1 = a.max(b);
            group.area_2 = a.min(b);
            let alone = group.area_2.if_above(F64x4::ZERO, F64x4::ZERO, one);
            group.weight_a = alone * main_a;
            group.weight_b = alone * (one - main_a);
            for l in 0..WIDTH {
                if group.area_2.0[l] > 0.0 {
                    let other = if main_a.0[l] > 0.5 { LINE_B } else { LINE_A };
                    let entry = BridgePort { lane: g * WIDTH + l, other, ..BridgePort::default() };
                    if let Some(bridge) = self.bridges.get_mut(self.bridge_count) {
                        *bridge = entry;
                        self.bridge_count += 1;
                    }
                }
            }
        }
    }

    /// Resets the iteration to known masses; earlier flows are discarded.
    pub fn restart(&mut self, masses: &Masses) {
        self.m = *masses;
        for group in &mut self.group {
            group.q = F64x4::ZERO;
            group.f = F64x4::ZERO;
            group.soft = F64x4::all(1.0);
            group.any_soft = true;
        }
    }

    /// First guess (predictor): chambers behind wide ports keep their pressure, the others follow their last rate.
    #[inline(always)]
    pub fn guess(&mut self, plant: &Plant, old: &Masses, star: &Masses, rate: &Masses, gh: f64) {
        let rho_0 = plant.oil.density_kg_m3();
        // gh * K * dp/dm against 2*sqrt(dp) at 0.3 MPa: a port as stiff as this equilibrates within the stage.
        let stiff = F64x4::all(2.0 * 0.3e6f64.sqrt() / (gh * 2.0 * STIFF_BETA_PA / rho_0));
        for g in 0..plant.groups.min(GROUPS) {
            let group = &mut self.group[g];
            let keeps = group.rho * group.volume;
            let follows = star.chamber[g] + F64x4::all(gh) * rate.chamber[g];
            let opening = group.area_1 * group.inv_v;
            let m = opening.if_above(stiff, keeps, follows);
            self.m.chamber[g] = m.max(F64x4::all(0.2) * old.chamber[g]);
            group.q = group.f / (group.area_1 * F64x4::all(2.0)).max(F64x4::all(1.0e-9));
            let open = group.area_1.if_above(F64x4::ZERO, F64x4::all(1.0), F64x4::ZERO);
            group.soft = opening.if_above(stiff, F64x4::ZERO, open);
            group.any_soft = group.soft.sum() > 0.0;
        }
        for i in 0..NODES {
            self.m.node[i] = (star.node[i] + gh * rate.node[i]).max(0.2 * old.node[i]);
        }
    }
}
