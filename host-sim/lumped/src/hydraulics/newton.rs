//! Newton's method for one implicit stage, the chambers eliminated (Schur complement of an arrowhead matrix).
//!
//! A stage of the integrator requires masses m with `m = m_star + gh * f(m)`, gh = gamma*h. Newton's method: every
//! chamber's row contains only its own mass and those of the two lines, so the chambers are eliminated into a 4 x 4
//! system of the nodes, which is solved and substituted back: the cost is linear in the number of chambers. Every flow
//! is computed once and enters both balances with opposite signs, its derivatives too, so every Newton iterate
//! conserves mass to rounding. Derivation: docs/full-model/integration.md.

use crate::layout::{CHARGE_GALLERY, FLUSHING_GALLERY, GROUPS, LANES, LINE_A, LINE_B, NODES};
use crate::plant::Plant;
use crate::simd::{F64x4, WIDTH};
use crate::valves::{self, LAMINAR_PA, MassFlow};

use super::masses::{MOTOR_TO_A, Masses, PUMP_TO_A};
use super::nodes::{circuit, solve_nodes};
use super::stage::ImplicitStage;

/// Convergence tolerance: largest Newton update as a fraction of a chamber's content. 3e-7 is 0.4 kPa; the error after
/// such an update is its square over the laminar transition, some pascals.
const UPDATE_TOL: f64 = 1.0e-5;
/// Iterations after which a stage counts as not converged and the step is halved.
const MAX_ITERATIONS: u32 = 25;

/// Failure of Newton's method on one stage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NotConverged {
    /// Last relative update.
    pub last_change: f64,
    /// Iterations.
    pub iterations: u32,
}

impl ImplicitStage {
    /// Solves `m = m_star + gh * f(m)` from the guess in `self.m`; afterwards `self.m` and the pressures are the
    /// solution and `self.m.flow` holds the flows.
    ///
    /// # Errors
    /// When Newton's method does not converge within its limit of iterations.
    #[inline(always)]
    pub fn solve(&mut self, plant: &Plant, star: &Masses, gh: f64, omega_p: f64) -> Result<(), NotConverged> {
        let groups = plant.groups.min(GROUPS);
        let inv_rho_0 = 1.0 / plant.oil.density_kg_m3();
        let charge = plant.charge.kg_s(omega_p);
        let (one, half, gh4) = (F64x4::all(1.0), F64x4::all(0.5), F64x4::all(gh));
        let (d, quarter_d2) = (F64x4::all(LAMINAR_PA), F64x4::all(0.25 * LAMINAR_PA * LAMINAR_PA));
        let half_inv_rho = F64x4::all(0.5 * inv_rho_0);
        let inv_rho4 = F64x4::all(inv_rho_0);
        let mut last_change = f64::INFINITY;
        for iteration in 1..=MAX_ITERATIONS {
            self.iterations += 1;
            let mut rho_n = [0.0; NODES];
            let mut slope_n = [0.0; NODES];
            let mut inv_vn = [0.0; NODES];
            for k in 0..NODES {
                inv_vn[k] = 1.0 / plant.node_m3[k];
                rho_n[k] = self.m.node[k] * inv_vn[k];
                let (p, slope) = plant.oil.pressure(rho_n[k]);
                self.p_node[k] = p;
                slope_n[k] = slope * inv_vn[k];
            }
            let line = |x: &[f64; NODES], is_a: F64x4| {
                is_a.if_above(half, F64x4::all(x[LINE_A]), F64x4::all(x[LINE_B]))
            };
            let (mut in_a, mut in_b, mut s_a, mut s_b) = (F64x4::ZERO, F64x4::ZERO, F64x4::ZERO, F64x4::ZERO);
            for g in 0..groups {
                let group = &mut self.group[g];
                group.rho = self.m.chamber[g] * group.inv_v;
                let (p, slope) = plant.oil.pressure4(group.rho);
                group.p = p;
                group.slope = slope * group.inv_v;
            }
            for g in 0..groups {
                let group = &mut self.group[g];
                // Main port: the flow law linearised at the current pressure drop where the chamber is soft, at the
                // current flow where it is stiff (see docs/full-model/integration.md).
                let is_a = group.main_a;
                let slope_line = line(&slope_n, is_a);
                let dp = group.p - line(&self.p_node, is_a);
                let mut q = group.q;
                if group.any_soft {
                    let w = (quarter_d2 + dp * dp).sqrt();
                    q = group.soft.if_above(half, dp / (half * d + w).sqrt(), q);
                }
                let out = q.if_above(F64x4::ZERO, one, F64x4::ZERO);
                let rho_up = out.if_above(half, group.rho, line(&rho_n, is_a));
                let k = group.area_1 * (one + rho_up * inv_rho4);
                let q2 = q * q;
                let s = (q2 + d).sqrt();
                let q_slope = s / (q2 + q2 + d);
                let q_miss = dp - q * s;
                let f = k * (q + q_miss * q_slope);
                let g_slope = k * q_slope;
                let by_rho = f * half_inv_rho;
                let d_own = g_slope * group.slope + out * by_rho * group.inv_v;
                let d_node = (one - out) * by_rho * line(&inv_vn, is_a) - g_slope * slope_line;
                // Leakage (paper eq. 3) at the density upstream.
                let over = group.p - F64x4::all(plant.case_pa);
                let leaks = over.if_above(F64x4::ZERO, one, F64x4::ZERO);
                let rho_leak = leaks.if_above(half, group.rho, F64x4::all(plant.case_rho));
                let kou = plant.kou_m3_s_pa[g];
                let leak = kou * rho_leak * over;
                let d_leak = kou * (rho_leak * group.slope + leaks * over * group.inv_v);
                let residual = self.m.chamber[g] - star.chamber[g] + gh4 * (f + leak);
                let inv_diag = one / (one + gh4 * (d_own + d_leak));
                // Elimination of the chamber: inflow of its line at known change, and its slope.
                let flow = f - d_own * residual * inv_diag;
                let slope = d_node * (one + gh4 * d_leak) * inv_diag;
                in_a += group.weight_a * flow;
                in_b += group.weight_b * flow;
                s_a += group.weight_a * slope;
                s_b += group.weight_b * slope;
                group.q = q;
                group.q_slope = q_slope;
                group.q_miss = q_miss;
                group.f = f;
                group.d_own = d_own;
                group.d_node = d_node;
                group.leak = leak;
                group.d_leak = d_leak;
                group.residual = residual;
                group.inv_diag = inv_diag;
            }
            let mut inflow = [in_a.sum(), in_b.sum(), 0.0, 0.0];
            let mut matrix = [[0.0; NODES]; NODES];
            matrix[LINE_A][LINE_A] = s_a.sum();
            matrix[LINE_B][LINE_B] = s_b.sum();
            self.eliminate_bridges(&rho_n, &slope_n, &inv_vn, inv_rho_0, gh, &mut inflow, &mut matrix);
            let relative = rho_n.map(|rho| rho * inv_rho_0);
            let drains = circuit(plant, &self.p_node, &relative, &slope_n, charge, &mut inflow, &mut matrix);
            let mut rhs = [0.0; NODES];
            for k in 0..NODES {
                rhs[k] = star.node[k] - self.m.node[k] + gh * inflow[k];
                for entry in &mut matrix[k] {
                    *entry *= -gh;
                }
                matrix[k][k] += 1.0;
            }
            let Some(change_n) = solve_nodes(&mut matrix, &mut rhs) else {
                return Err(NotConverged { last_change, iterations: iteration });
            };
            // Back substitution; the flow at which a stiff port is linearised next follows its new pressure drop.
            let mut largest = F64x4::ZERO;
            for g in 0..groups {
                let group = &mut self.group[g];
                let change_line = line(&change_n, group.main_a);
                group.change =
                    F64x4::ZERO - (group.residual + gh4 * group.d_node * change_line) * group.inv_diag;
            }
            for bridge in &self.bridges[..self.bridge_count.min(LANES)] {
                let (group, l) = (&mut self.group[bridge.lane / WIDTH], bridge.lane % WIDTH);
                group.change.0[l] -= gh * bridge.d_node * change_n[bridge.other] * group.inv_diag.0[l];
            }
            for g in 0..groups {
                let group = &mut self.group[g];
                let is_a = group.main_a;
                largest = (group.change * group.inv_v).abs().max(largest);
                let drop = group.slope * group.change - line(&slope_n, is_a) * line(&change_n, is_a);
                group.q += (group.q_miss + drop) * group.q_slope;
            }
            last_change = largest.largest();
            for (change, inv_v) in change_n.iter().zip(&inv_vn) {
                last_change = last_change.max(change.abs() * inv_v);
            }
            last_change *= inv_rho_0;
            if last_change < UPDATE_TOL {
                self.finish(plant, charge, &drains, &slope_n, &change_n);
                return Ok(());
            }
            // A chamber keeps at least a fifth of its content per iteration, so that it cannot turn negative.
            let keep = F64x4::all(0.2);
            let mut finite = 0.0;
            for g in 0..groups {
                let m = self.m.chamber[g];
                finite += (self.group[g].change * F64x4::ZERO).sum();
                self.m.chamber[g] = (m + self.group[g].change).max(keep * m);
            }
            for (m, change) in self.m.node.iter_mut().zip(&change_n) {
                finite += change * 0.0;
                *m = (*m + change).max(0.2 * *m);
            }
            if finite != 0.0 {
                return Err(NotConverged { last_change, iterations: iteration });
            }
        }
        Err(NotConverged { last_change, iterations: MAX_ITERATIONS })
    }

    /// Eliminates the chambers that are open to both kidneys: their masses couple both lines.
    #[inline(always)]
    #[expect(
        clippy::too_many_arguments,
        reason = "parts of one linear system, passed separately so that they stay in registers"
    )]
    fn eliminate_bridges(
        &mut self,
        rho_n: &[f64; NODES],
        slope_n: &[f64; NODES],
        inv_vn: &[f64; NODES],
        inv_rho_0: f64,
        gh: f64,
        inflow: &mut [f64; NODES],
        matrix: &mut [[f64; NODES]; NODES],
    ) {
        for bridge in &mut self.bridges[..self.bridge_count.min(LANES)] {
            let (group, l) = (&mut self.group[bridge.lane / WIDTH], bridge.lane % WIDTH);
            let other = bridge.other;
            let main = LINE_B - other;
            let flow = valves::orifice(
                group.area_2.0[l],
                group.p.0[l],
                self.p_node[other],
                group.rho.0[l] * inv_rho_0,
                rho_n[other] * inv_rho_0,
            );
            let by_rho = 0.5 * flow.kg_s * inv_rho_0;
            let out = flow.kg_s > 0.0;
            let d_own = flow.d_from * group.slope.0[l] + if out { by_rho * group.inv_v.0[l] } else { 0.0 };
            let d_node = flow.d_to * slope_n[other] + if out { 0.0 } else { by_rho * inv_vn[other] };
            group.residual.0[l] += gh * flow.kg_s;
            let (d_main, d_own_main, d_leak) = (group.d_node.0[l], group.d_own.0[l], group.d_leak.0[l]);
            let inv_diag = 1.0 / (1.0 + gh * (d_own_main + d_leak + d_own));
            group.inv_diag.0[l] = inv_diag;
            let known = -group.residual.0[l] * inv_diag;
            inflow[main] += group.f.0[l] + d_own_main * known;
            inflow[other] += flow.kg_s + d_own * known;
            matrix[main][main] += d_main * (1.0 + gh * (d_own + d_leak)) * inv_diag;
            matrix[other][other] += d_node * (1.0 + gh * (d_own_main + d_leak)) * inv_diag;
            matrix[main][other] -= d_own_main * gh * d_node * inv_diag;
            matrix[other][main] -= d_own * gh * d_main * inv_diag;
            bridge.f = flow.kg_s;
            bridge.d_own = d_own;
            bridge.d_node = d_node;
        }
    }

    /// Applies the last update and computes the flows of the linearised equations, by which the masses changed.
    #[inline(always)]
    fn finish(
        &mut self,
        plant: &Plant,
        charge: f64,
        drains: &[MassFlow; 2],
        slope_n: &[f64; NODES],
        change_n: &[f64; NODES],
    ) {
        let (one, half) = (F64x4::all(1.0), F64x4::all(0.5));
        let mut sums = [F64x4::ZERO; 6];
        for g in 0..plant.groups.min(GROUPS) {
            let group = &mut self.group[g];
            let is_a = group.main_a;
            let node = is_a.if_above(half, F64x4::all(change_n[LINE_A]), F64x4::all(change_n[LINE_B]));
            group.f += group.d_own * group.change + group.d_node * node;
            let leak = group.leak + group.d_leak * group.change;
            let (to_a, to_b) = (group.f * is_a, group.f * (one - is_a));
            let (pump, motor) = (plant.is_pump[g], one - plant.is_pump[g]);
            for (sum, x) in sums.iter_mut().zip([
                pump * leak,
                motor * leak,
                pump * to_a,
                pump * to_b,
                motor * to_a,
                motor * to_b,
            ]) {
                *sum += x;
            }
            self.m.chamber[g] += group.change;
            group.p += group.slope * group.change;
            group.rho = self.m.chamber[g] * group.inv_v;
        }
        let relief = drains[0].kg_s
            + drains[0].d_from * slope_n[CHARGE_GALLERY] * change_n[CHARGE_GALLERY]
            + drains[1].kg_s
            + drains[1].d_from * slope_n[FLUSHING_GALLERY] * change_n[FLUSHING_GALLERY];
        let mut flow = [
            charge,
            relief,
            sums[0].sum(),
            sums[1].sum(),
            sums[2].sum(),
            sums[3].sum(),
            sums[4].sum(),
            sums[5].sum(),
        ];
        for bridge in &self.bridges[..self.bridge_count.min(LANES)] {
            let change = self.group[bridge.lane / WIDTH].change.0[bridge.lane % WIDTH];
            let f = bridge.f + bridge.d_own * change + bridge.d_node * change_n[bridge.other];
            let a_at = if bridge.lane < plant.pump_pistons { PUMP_TO_A } else { MOTOR_TO_A };
            flow[a_at + bridge.other] += f;
        }
        self.m.flow = flow;
        for k in 0..NODES {
            self.m.node[k] += change_n[k];
            self.p_node[k] += slope_n[k] * change_n[k];
        }
    }
}
