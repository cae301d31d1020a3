//! Mass balances of all chambers and nodes at one instant, solved implicitly with the arrowhead eliminated.
//!
//! One stage of the integrator asks for masses m with `m = m_star + gh * f(m)`, gh = gamma*h. Newton's method: every
//! chamber row has only its own mass and those of the two lines, so it is eliminated into a 4 x 4 system of the nodes,
//! solved, and substituted back: cost in proportion to the chambers. Fluxes are computed once per edge and enter both
//! ends with opposite signs, derivatives too, so every Newton iterate conserves mass to rounding.

use super::lanes::{V4, WIDTH};
use super::plant::{A, B, C, F, GROUPS, LANES, NODES, Plant};
use super::valves::{self, Flow, LAMINAR_PA};

/// Bulk modulus by which the first guess tells stiff ports from soft ones; its exact value only costs iterations.
const STIFF_BETA_PA: f64 = 1.2e9;

/// Newton updates of the last iteration, as a fraction of a chamber's content, at which a stage is accepted. 3e-7 is
/// 0.4 kPa; the error left after such an update is its square over the laminar transition, some pascals.
const ACCEPT: f64 = 1.0e-5;
/// Iterations after which a stage is given up and the step halved.
const MAX_ITERATIONS: u32 = 25;

/// Flows across the system boundary and through the ports, integrated beside the masses.
pub const FLOWS: usize = 8;
/// Charge pump into the gallery.
pub const CHARGE: usize = 0;
/// Relief valves 4 and 10 to the case.
pub const RELIEF: usize = 1;
/// Leakage of the pump's chambers to the case.
pub const LEAK_PUMP: usize = 2;
/// Leakage of the motor's chambers.
pub const LEAK_MOTOR: usize = 3;
/// Pump chambers into line A.
pub const PUMP_A: usize = 4;
/// Pump chambers into line B.
pub const PUMP_B: usize = 5;
/// Motor chambers into line A.
pub const MOTOR_A: usize = 6;
/// Motor chambers into line B.
pub const MOTOR_B: usize = 7;

/// Masses of all chambers and nodes, or their rates.
#[derive(Debug, Clone, Copy)]
pub struct Masses {
    /// Chambers, pump first.
    pub chamber: [V4; GROUPS],
    /// Lines and galleries.
    pub node: [f64; NODES],
    /// Integrated flows (or flows).
    pub flow: [f64; FLOWS],
}

impl Default for Masses {
    fn default() -> Self {
        Self { chamber: [V4::ZERO; GROUPS], node: [0.0; NODES], flow: [0.0; FLOWS] }
    }
}

/// Why a stage was given up: size of the last update and iterations made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GaveUp {
    /// Last relative update.
    pub last_change: f64,
    /// Iterations.
    pub iterations: u32,
}

/// One group of four chambers at one instant: geometry, current iterate, linearised flows.
#[derive(Debug, Clone, Copy, Default)]
struct Group {
    phi: V4,
    volume: V4,
    inv_v: V4,
    /// dV/dt.
    v_rate: V4,
    /// Conductance of the wider port; 1 in `main_a` where that port leads to line A.
    area_1: V4,
    main_a: V4,
    /// Conductance of the other port: not zero only where a chamber bridges both kidneys.
    area_2: V4,
    /// Shares in the vector sums of line A and B; 0 for a bridging chamber, which is handled apart.
    weight_a: V4,
    weight_b: V4,
    rho: V4,
    p: V4,
    slope: V4,
    /// Square root of the pressure drop that the main port's flow corresponds to, and
    /// whether the flow is linearised at the pressure drop (soft) or at the flow (stiff).
    q: V4,
    soft: V4,
    any_soft: bool,
    q_slope: V4,
    q_miss: V4,
    f: V4,
    d_own: V4,
    d_node: V4,
    leak: V4,
    d_leak: V4,
    residual: V4,
    inv_diag: V4,
    change: V4,
}

/// Second port of a chamber that bridges both kidneys.
#[derive(Debug, Clone, Copy, Default)]
struct Second {
    lane: usize,
    other: usize,
    f: f64,
    d_own: f64,
    d_node: f64,
}

/// Volumes and port areas at one instant, and everything Newton's method computes there.
#[derive(Debug, Clone)]
pub struct Stage {
    /// Current iterate, in the end the solution.
    pub m: Masses,
    /// Absolute pressures of the nodes.
    pub p_node: [f64; NODES],
    group: [Group; GROUPS],
    second: [Second; LANES],
    seconds: usize,
    /// Newton iterations made so far, for statistics.
    pub iterations: u64,
}

impl Default for Stage {
    fn default() -> Self {
        Self {
            m: Masses::default(),
            p_node: [0.0; NODES],
            group: [Group::default(); GROUPS],
            second: [Second::default(); LANES],
            seconds: 0,
            iterations: 0,
        }
    }
}

/// Where the shafts stand and how fast they turn at one instant.
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

impl Stage {
    /// Volume of one chamber as placed.
    #[must_use]
    pub fn volume_m3(&self, lane: usize) -> f64 {
        self.group[lane / WIDTH].volume.0[lane % WIDTH]
    }

    /// Conductance of one chamber's ports as placed, to line A and to line B.
    #[must_use]
    pub fn conductance(&self, lane: usize) -> (f64, f64) {
        let (g, l) = (&self.group[lane / WIDTH], lane % WIDTH);
        let (wide, narrow) = (g.area_1.0[l], g.area_2.0[l]);
        if g.main_a.0[l] > 0.5 { (wide, narrow) } else { (narrow, wide) }
    }

    /// Absolute pressures of the chambers after a solution.
    #[inline(always)]
    #[must_use]
    pub fn pressures(&self) -> [V4; GROUPS] {
        std::array::from_fn(|g| self.group[g].p)
    }

    /// Whether a placed chamber belongs to line A: by the wider port, or by the half turn when both are shut.
    #[must_use]
    pub fn nearer_to_a(&self, lane: usize, pump: bool) -> bool {
        let (g, l) = (&self.group[lane / WIDTH], lane % WIDTH);
        if g.area_1.0[l] > 0.0 {
            return g.main_a.0[l] > 0.5;
        }
        (g.phi.0[l] < std::f64::consts::PI) != pump
    }

    /// Places the chambers: volumes and port areas at one instant.
    ///
    /// V = V_0 + V_s/2 * (1 - alpha*cos(phi)); the motor's alpha is 1.
    #[inline(always)]
    pub fn place(&mut self, plant: &Plant, at: &Kinematics) {
        let (sin_p, cos_p) = at.phi_p.sin_cos();
        let (sin_m, cos_m) = at.phi_m.sin_cos();
        let (half, one, tau) = (V4::all(0.5), V4::all(1.0), V4::all(std::f64::consts::TAU));
        self.seconds = 0;
        for g in 0..plant.groups.min(GROUPS) {
            let group = &mut self.group[g];
            let pick = |pump: f64, motor: f64| plant.is_pump[g].if_above(half, V4::all(pump), V4::all(motor));
            let turned = pick(at.phi_p, at.phi_m) + plant.offset_rad[g];
            let phi = turned - turned.if_above(tau, tau, V4::ZERO);
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
            let main_a = b.if_above(a, V4::ZERO, one);
            // The flow through a port that stays the same changes by the piston's own flow; a new port starts with it.
            let same = V4::all(0.1).if_above((main_a - group.main_a).abs(), one, V4::ZERO);
            group.f = same * (group.f + group.rho * group.v_rate) - group.rho * v_rate;
            group.v_rate = v_rate;
            group.main_a = main_a;
            group.area_1 = a.max(b);
            group.area_2 = a.min(b);
            let alone = group.area_2.if_above(V4::ZERO, V4::ZERO, one);
            group.weight_a = alone * main_a;
            group.weight_b = alone * (one - main_a);
            for l in 0..WIDTH {
                if group.area_2.0[l] > 0.0 {
                    let other = if main_a.0[l] > 0.5 { B } else { A };
                    let entry = Second { lane: g * WIDTH + l, other, ..Second::default() };
                    if let Some(second) = self.second.get_mut(self.seconds) {
                        *second = entry;
                        self.seconds += 1;
                    }
                }
            }
        }
    }

    /// Starts from known masses with no memory of earlier flows.
    pub fn restart(&mut self, masses: &Masses) {
        self.m = *masses;
        for group in &mut self.group {
            group.q = V4::ZERO;
            group.f = V4::ZERO;
            group.soft = V4::all(1.0);
            group.any_soft = true;
        }
    }

    /// First guess of a stage: chambers behind wide ports keep their pressure, the others follow their last rate.
    #[inline(always)]
    pub fn guess(&mut self, plant: &Plant, old: &Masses, star: &Masses, rate: &Masses, gh: f64) {
        let rho_0 = plant.oil.density_kg_m3();
        // gh * K * dp/dm against 2*sqrt(dp) at 0.3 MPa: a port as stiff as this settles within the stage.
        let stiff = V4::all(2.0 * 0.3e6f64.sqrt() / (gh * 2.0 * STIFF_BETA_PA / rho_0));
        for g in 0..plant.groups.min(GROUPS) {
            let group = &mut self.group[g];
            let keeps = group.rho * group.volume;
            let follows = star.chamber[g] + V4::all(gh) * rate.chamber[g];
            let opening = group.area_1 * group.inv_v;
            let m = opening.if_above(stiff, keeps, follows);
            self.m.chamber[g] = m.max(V4::all(0.2) * old.chamber[g]);
            group.q = group.f / (group.area_1 * V4::all(2.0)).max(V4::all(1.0e-9));
            let open = group.area_1.if_above(V4::ZERO, V4::all(1.0), V4::ZERO);
            group.soft = opening.if_above(stiff, V4::ZERO, open);
            group.any_soft = group.soft.sum() > 0.0;
        }
        for i in 0..NODES {
            self.m.node[i] = (star.node[i] + gh * rate.node[i]).max(0.2 * old.node[i]);
        }
    }

    /// Solves `m = m_star + gh * f(m)` from the guess in `self.m`; afterwards `self.m` and the pressures are the
    /// solution and `self.m.flow` holds the flows.
    ///
    /// # Errors
    /// When Newton's method does not settle within its limit.
    #[inline(always)]
    pub fn solve(&mut self, plant: &Plant, star: &Masses, gh: f64, omega_p: f64) -> Result<(), GaveUp> {
        let groups = plant.groups.min(GROUPS);
        let inv_rho_0 = 1.0 / plant.oil.density_kg_m3();
        let charge = plant.charge.kg_s(omega_p);
        let (one, half, gh4) = (V4::all(1.0), V4::all(0.5), V4::all(gh));
        let (d, quarter_d2) = (V4::all(LAMINAR_PA), V4::all(0.25 * LAMINAR_PA * LAMINAR_PA));
        let half_inv_rho = V4::all(0.5 * inv_rho_0);
        let inv_rho4 = V4::all(inv_rho_0);
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
            let line = |x: &[f64; NODES], is_a: V4| is_a.if_above(half, V4::all(x[A]), V4::all(x[B]));
            let (mut in_a, mut in_b, mut s_a, mut s_b) = (V4::ZERO, V4::ZERO, V4::ZERO, V4::ZERO);
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
                let out = q.if_above(V4::ZERO, one, V4::ZERO);
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
                // Leakage, eq. 3, at the density of the side it comes from.
                let over = group.p - V4::all(plant.case_pa);
                let leaks = over.if_above(V4::ZERO, one, V4::ZERO);
                let rho_leak = leaks.if_above(half, group.rho, V4::all(plant.case_rho));
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
            matrix[A][A] = s_a.sum();
            matrix[B][B] = s_b.sum();
            self.eliminate_bridges(&rho_n, &slope_n, &inv_vn, inv_rho_0, gh, &mut inflow, &mut matrix);
            let relative = rho_n.map(|rho| rho * inv_rho_0);
            let drains = circuit(plant, &self.p_node, &relative, &slope_n, charge, &mut inflow, &mut matrix);
            let mut right = [0.0; NODES];
            for k in 0..NODES {
                right[k] = star.node[k] - self.m.node[k] + gh * inflow[k];
                for entry in &mut matrix[k] {
                    *entry *= -gh;
                }
                matrix[k][k] += 1.0;
            }
            let Some(change_n) = solve_nodes(&mut matrix, &mut right) else {
                return Err(GaveUp { last_change, iterations: iteration });
            };
            // Back substitution; the flow at which a stiff port is linearised next follows its new pressure drop.
            let mut largest = V4::ZERO;
            for g in 0..groups {
                let group = &mut self.group[g];
                let change_line = line(&change_n, group.main_a);
                group.change =
                    V4::ZERO - (group.residual + gh4 * group.d_node * change_line) * group.inv_diag;
            }
            for second in &self.second[..self.seconds.min(LANES)] {
                let (group, l) = (&mut self.group[second.lane / WIDTH], second.lane % WIDTH);
                group.change.0[l] -= gh * second.d_node * change_n[second.other] * group.inv_diag.0[l];
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
            if last_change < ACCEPT {
                self.finish(plant, charge, &drains, &slope_n, &change_n);
                return Ok(());
            }
            // A chamber keeps at least a fifth of its content per iteration, so that it cannot turn negative.
            let keep = V4::all(0.2);
            let mut finite = 0.0;
            for g in 0..groups {
                let m = self.m.chamber[g];
                finite += (self.group[g].change * V4::ZERO).sum();
                self.m.chamber[g] = (m + self.group[g].change).max(keep * m);
            }
            for (m, change) in self.m.node.iter_mut().zip(&change_n) {
                finite += change * 0.0;
                *m = (*m + change).max(0.2 * *m);
            }
            if finite != 0.0 {
                return Err(GaveUp { last_change, iterations: iteration });
            }
        }
        Err(GaveUp { last_change, iterations: MAX_ITERATIONS })
    }

    /// Eliminates chambers that are open to both kidneys: their mass couples both lines.
    #[inline(always)]
    #[expect(
        clippy::too_many_arguments,
        reason = "one linear system, taken apart so that it stays in registers"
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
        for second in &mut self.second[..self.seconds.min(LANES)] {
            let (group, l) = (&mut self.group[second.lane / WIDTH], second.lane % WIDTH);
            let other = second.other;
            let main = B - other;
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
            second.f = flow.kg_s;
            second.d_own = d_own;
            second.d_node = d_node;
        }
    }

    /// Applies the last update and takes the flows of the linearised equations, which are what the masses moved by.
    #[inline(always)]
    fn finish(
        &mut self,
        plant: &Plant,
        charge: f64,
        drains: &[Flow; 2],
        slope_n: &[f64; NODES],
        change_n: &[f64; NODES],
    ) {
        let (one, half) = (V4::all(1.0), V4::all(0.5));
        let mut sums = [V4::ZERO; 6];
        for g in 0..plant.groups.min(GROUPS) {
            let group = &mut self.group[g];
            let is_a = group.main_a;
            let node = is_a.if_above(half, V4::all(change_n[A]), V4::all(change_n[B]));
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
            + drains[0].d_from * slope_n[C] * change_n[C]
            + drains[1].kg_s
            + drains[1].d_from * slope_n[F] * change_n[F];
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
        for second in &self.second[..self.seconds.min(LANES)] {
            let change = self.group[second.lane / WIDTH].change.0[second.lane % WIDTH];
            let f = second.f + second.d_own * change + second.d_node * change_n[second.other];
            let a_at = if second.lane < plant.pump_pistons { PUMP_A } else { MOTOR_A };
            flow[a_at + second.other] += f;
        }
        self.m.flow = flow;
        for k in 0..NODES {
            self.m.node[k] += change_n[k];
            self.p_node[k] += slope_n[k] * change_n[k];
        }
    }
}

/// Adds the circuit's valves (paper fig. 1) to the nodes' inflows and their slopes with respect to the nodes' masses.
/// Returns the flows to the case of relief valves 4 and 10.
#[inline(always)]
fn circuit(
    plant: &Plant,
    p: &[f64; NODES],
    relative_rho: &[f64; NODES],
    slope: &[f64; NODES],
    charge: f64,
    inflow: &mut [f64; NODES],
    matrix: &mut [[f64; NODES]; NODES],
) -> [Flow; 2] {
    let mut edge = |from: usize, to: usize, flow: Flow| {
        inflow[from] -= flow.kg_s;
        inflow[to] += flow.kg_s;
        matrix[from][from] -= flow.d_from * slope[from];
        matrix[from][to] -= flow.d_to * slope[to];
        matrix[to][from] += flow.d_from * slope[from];
        matrix[to][to] += flow.d_to * slope[to];
    };
    for line in [A, B] {
        // Check valves 5 and 6; high-pressure relief valves, when fitted.
        edge(C, line, plant.check_valve.flow(p[C], p[line], relative_rho[C]));
        if let Some(relief) = &plant.high_relief {
            edge(line, C, relief.flow(p[line], p[C]));
        }
    }
    // Shuttle valve 9: the side of the lower line, moved by the other line's pressure as well.
    for (line, other) in [(A, B), (B, A)] {
        let (flow, by_other) =
            plant.shuttle.flow(p[line], p[other], p[F], (relative_rho[line], relative_rho[F]));
        if flow != Flow::default() {
            edge(line, F, flow);
            matrix_add(matrix, line, F, other, by_other * slope[other]);
            break;
        }
    }
    // Relief valves 4 and 10 to the case; gear pump 3.
    let drains =
        [plant.charge_relief.flow(p[C], plant.case_pa), plant.flushing_relief.flow(p[F], plant.case_pa)];
    for (node, drain) in [(C, drains[0]), (F, drains[1])] {
        inflow[node] -= drain.kg_s;
        matrix[node][node] -= drain.d_from * slope[node];
    }
    inflow[C] += charge;
    drains
}

/// Derivative of a flow `from` -> `to` with respect to a third node.
#[inline(always)]
fn matrix_add(matrix: &mut [[f64; NODES]; NODES], from: usize, to: usize, third: usize, slope: f64) {
    matrix[from][third] -= slope;
    matrix[to][third] += slope;
}

/// Gaussian elimination with partial pivoting; `None` when the matrix is singular or not finite.
#[inline(always)]
fn solve_nodes(matrix: &mut [[f64; NODES]; NODES], right: &mut [f64; NODES]) -> Option<[f64; NODES]> {
    for k in 0..NODES {
        let mut pivot = k;
        for row in k + 1..NODES {
            if matrix[row][k].abs() > matrix[pivot][k].abs() {
                pivot = row;
            }
        }
        if pivot != k {
            matrix.swap(k, pivot);
            right.swap(k, pivot);
        }
        let diagonal = matrix[k][k];
        if !(diagonal.abs() > 0.0 && diagonal.is_finite()) {
            return None;
        }
        let inv = 1.0 / diagonal;
        for row in k + 1..NODES {
            let factor = matrix[row][k] * inv;
            let pivot_row = matrix[k];
            for (entry, above) in matrix[row].iter_mut().zip(pivot_row).skip(k + 1) {
                *entry -= factor * above;
            }
            right[row] -= factor * right[k];
        }
    }
    let mut x = [0.0; NODES];
    for k in (0..NODES).rev() {
        let mut sum = right[k];
        for column in k + 1..NODES {
            sum -= matrix[k][column] * x[column];
        }
        x[k] = sum / matrix[k][k];
    }
    Some(x)
}
