//! Time step of the whole drive: shafts, swash actuator and oil.
//!
//! A step from t to t + h does, in this order:
//!
//! ```text
//! omega_half = omega + h/2 * torque(t)/J                       half a kick of the shafts
//! alpha(t + h) from the actuator's law
//! masses by ESDIRK, angles phi + omega_half*c*h, alpha linear  the oil, all stages implicit
//! torque(t + h) from the new pressures
//! omega = omega_half + h/2 * torque(t + h)/J                   half a kick
//! ```
//!
//! Stoermer-Verlet splitting (order 2) for the shafts around an L-stable ESDIRK method for the oil. The shafts'
//! frequencies are some tens of hertz, far below 1/h, and need no implicit method; the oil's are 1e7 1/s. When Newton's
//! method does not converge, the step is halved, up to a limit, and then the run stops with an error.

use std::f64::consts::TAU;

use crate::error::SimError;
use crate::hydraulics::{ImplicitStage, Kinematics, Masses, NotConverged};
use crate::layout::{GROUPS, LINE_A, LINE_B, NODES};
use crate::oil::{ATMOSPHERE_PA, MAX_PRESSURE_PA};
use crate::plant::Plant;
use crate::plant_state::{PlantInputs, PlantState};
use crate::shaft::{self, ShaftDrive, ShaftLoad};
use crate::simd::{F64x4, WIDTH};
use crate::tableau::{ButcherTableau, MAX_STAGES, Method};

/// Halvings of a step before the run stops: 1/4096 of a default step is below a nanosecond of port motion.
const MAX_HALVINGS: u32 = 12;

/// Steps a [`PlantState`] forward; owns the work space, so that stepping allocates nothing.
#[derive(Debug)]
pub struct Integrator<'a> {
    plant: &'a Plant,
    tableau: ButcherTableau,
    stage: ImplicitStage,
    k: [Masses; MAX_STAGES],
    steps: u64,
    halvings: u64,
}

impl<'a> Integrator<'a> {
    /// Integrator of a plant.
    #[must_use]
    pub fn new(plant: &'a Plant, method: Method) -> Self {
        Self {
            plant,
            tableau: method.tableau(),
            stage: ImplicitStage::default(),
            k: [Masses::default(); MAX_STAGES],
            steps: 0,
            halvings: 0,
        }
    }

    /// Steps, Newton iterations and halvings so far.
    #[must_use]
    pub fn counters(&self) -> (u64, u64, u64) {
        (self.steps, self.stage.iterations, self.halvings)
    }

    /// Initial state: chambers open to a line at that line's pressure, the others at the nearer kidney's.
    ///
    /// Pressures are absolute; angles and speeds are the caller's.
    #[must_use]
    pub fn initial(
        &mut self,
        p_a_pa: f64,
        p_b_pa: f64,
        inputs: &PlantInputs,
        alpha: f64,
        phi_m_rad: f64,
    ) -> PlantState {
        let plant = self.plant;
        let low = p_a_pa.min(p_b_pa);
        let mut state = PlantState {
            time_s: 0.0,
            masses: Masses::default(),
            phi_p_rad: 0.0,
            phi_m_rad,
            omega_p_rad_s: match inputs.drive {
                ShaftDrive::SpeedRadS(omega) => omega,
                ShaftDrive::Governed { set_rad_s, .. } => set_rad_s,
            },
            omega_m_rad_s: match inputs.load {
                ShaftLoad::SpeedRadS(omega) => omega,
                _ => 0.0,
            },
            alpha,
            torque_p_nm: 0.0,
            torque_m_nm: 0.0,
            p_chamber_pa: [F64x4::all(plant.case_pa); GROUPS],
            p_node_pa: [p_a_pa, p_b_pa, low, low],
            rates: Masses::default(),
            rates_known: false,
        };
        let (rho_a, rho_b) = (plant.oil.density_at(p_a_pa), plant.oil.density_at(p_b_pa));
        let rho_low = plant.oil.density_at(low);
        for (k, rho) in [rho_a, rho_b, rho_low, rho_low].into_iter().enumerate() {
            state.masses.node[k] = plant.node_m3[k] * rho;
        }
        self.stage.place(plant, &kinematics(&state));
        for lane in 0..plant.groups * WIDTH {
            let (g, l) = (lane / WIDTH, lane % WIDTH);
            let to_a = lane < plant.chambers() && self.stage.nearer_to_a(lane, lane < plant.pump_pistons);
            state.masses.chamber[g].0[l] = self.stage.volume_m3(lane) * if to_a { rho_a } else { rho_b };
            state.p_chamber_pa[g].0[l] = if to_a { p_a_pa } else { p_b_pa };
        }
        (state.torque_p_nm, state.torque_m_nm) = self.torques(&state);
        state
    }

    /// Advances the state by `h`, halving the step where Newton's method does not converge.
    ///
    /// # Errors
    /// When the step cannot be made, or a pressure leaves the oil table.
    #[inline(always)]
    pub fn step(&mut self, state: &mut PlantState, inputs: &PlantInputs, h: f64) -> Result<(), SimError> {
        if let Err(failure) = self.try_step(state, inputs, h) {
            self.halved(state, inputs, h, failure)?;
        }
        let highest = state.p_node_pa[LINE_A].max(state.p_node_pa[LINE_B]);
        if highest >= MAX_PRESSURE_PA {
            return Err(SimError::PressureTooHigh {
                place: if state.p_node_pa[LINE_A] > state.p_node_pa[LINE_B] { "line A" } else { "line B" },
                time_s: state.time_s,
                pressure_mpa: 1.0e-6 * (highest - ATMOSPHERE_PA),
                limit_mpa: 1.0e-6 * (MAX_PRESSURE_PA - ATMOSPHERE_PA),
            });
        }
        Ok(())
    }

    /// Makes the step in `2^k` parts, k growing until all parts succeed.
    #[cold]
    #[inline(never)]
    fn halved(
        &mut self,
        state: &mut PlantState,
        inputs: &PlantInputs,
        h: f64,
        first: NotConverged,
    ) -> Result<(), SimError> {
        let mut failure = first;
        for halving in 1..=MAX_HALVINGS {
            self.halvings += 1;
            let parts = 1u32 << halving;
            let part = h / f64::from(parts);
            let mut trial = state.clone();
            // Poor initial rates of the stiff chambers are the most frequent cause, so they are computed anew.
            trial.rates_known = false;
            match (0..parts).try_for_each(|_| self.try_step(&mut trial, inputs, part)) {
                Ok(()) => {
                    *state = trial;
                    return Ok(());
                }
                Err(e) => failure = e,
            }
        }
        Err(SimError::NotConverged {
            time_s: state.time_s,
            step_s: h / f64::from(1u32 << MAX_HALVINGS),
            last_change: failure.last_change,
            iterations: failure.iterations,
        })
    }

    /// One undivided step; a failure leaves the state unchanged.
    #[inline(always)]
    fn try_step(&mut self, state: &mut PlantState, inputs: &PlantInputs, h: f64) -> Result<(), NotConverged> {
        let plant = self.plant;
        let t = self.tableau;
        if !state.rates_known {
            self.find_rates(state)?;
        }
        let omega_p = self.pump_kick(state, inputs, state.omega_p_rad_s, 0.5 * h, state.torque_p_nm);
        let omega_m = self.motor_kick(state.omega_m_rad_s, inputs, 0.5 * h, state.torque_m_nm);
        let alpha = shaft::swash(state.alpha, inputs.alpha, h, plant.swash);
        self.k[0] = state.rates;
        let gh = t.gamma * h;
        let inv_gh = 1.0 / gh;
        let groups = plant.groups.min(GROUPS);
        for s in 1..t.stages.min(MAX_STAGES) {
            let c = t.c[s];
            self.stage.place(
                plant,
                &Kinematics {
                    phi_p: (state.phi_p_rad + omega_p * c * h).rem_euclid(TAU),
                    phi_m: (state.phi_m_rad + omega_m * c * h).rem_euclid(TAU),
                    omega_p,
                    omega_m,
                    alpha: state.alpha + c * (alpha - state.alpha),
                },
            );
            let mut star = state.masses;
            for j in 0..s {
                let w = h * t.a[s][j];
                for g in 0..groups {
                    star.chamber[g] += F64x4::all(w) * self.k[j].chamber[g];
                }
                for i in 0..NODES {
                    star.node[i] += w * self.k[j].node[i];
                }
            }
            self.stage.guess(plant, &state.masses, &star, &self.k[s - 1], gh);
            self.stage.solve(plant, &star, gh, omega_p)?;
            for g in 0..groups {
                self.k[s].chamber[g] = (self.stage.m.chamber[g] - star.chamber[g]) * F64x4::all(inv_gh);
            }
            for i in 0..NODES {
                self.k[s].node[i] = (self.stage.m.node[i] - star.node[i]) * inv_gh;
            }
            self.k[s].flow = self.stage.m.flow;
        }
        let last = t.stages.min(MAX_STAGES) - 1;
        let mut flow = state.masses.flow;
        for (i, total) in flow.iter_mut().enumerate() {
            let mut rate = t.gamma * self.k[last].flow[i];
            for j in 0..last {
                rate += t.a[last][j] * self.k[j].flow[i];
            }
            *total += h * rate;
        }
        state.masses = self.stage.m;
        state.masses.flow = flow;
        state.rates = self.k[last];
        state.rates_known = true;
        state.p_chamber_pa = self.stage.pressures();
        state.p_node_pa = self.stage.p_node;
        state.phi_p_rad += omega_p * h;
        state.phi_m_rad += omega_m * h;
        state.alpha = alpha;
        state.time_s += h;
        (state.torque_p_nm, state.torque_m_nm) = self.torques(state);
        state.omega_p_rad_s = self.pump_kick(state, inputs, omega_p, 0.5 * h, state.torque_p_nm);
        state.omega_m_rad_s = self.motor_kick(omega_m, inputs, 0.5 * h, state.torque_m_nm);
        self.steps += 1;
        Ok(())
    }

    /// Rates at the state itself, from an implicit stage too short for any motion.
    #[inline(never)]
    fn find_rates(&mut self, state: &mut PlantState) -> Result<(), NotConverged> {
        const SHORT_S: f64 = 1.0e-12;
        self.stage.place(self.plant, &kinematics(state));
        let star = state.masses;
        self.stage.restart(&star);
        self.stage.solve(self.plant, &star, SHORT_S, state.omega_p_rad_s)?;
        for g in 0..GROUPS {
            state.rates.chamber[g] = (self.stage.m.chamber[g] - star.chamber[g]) * F64x4::all(1.0 / SHORT_S);
        }
        for i in 0..NODES {
            state.rates.node[i] = (self.stage.m.node[i] - star.node[i]) / SHORT_S;
        }
        state.rates.flow = self.stage.m.flow;
        state.rates_known = true;
        Ok(())
    }

    #[inline(always)]
    fn pump_kick(&self, state: &PlantState, inputs: &PlantInputs, omega: f64, dt: f64, torque: f64) -> f64 {
        match (inputs.drive, self.plant.pump_inertia_kg_m2) {
            (ShaftDrive::Governed { set_rad_s, nm_s, limit_nm }, Some(j)) => {
                let sign = if set_rad_s < 0.0 { -1.0 } else { 1.0 };
                let engine = sign * (sign * nm_s * (set_rad_s - omega)).clamp(0.0, limit_nm);
                shaft::kick(omega, dt, j, engine + torque, self.plant.pump_friction, 0.0)
            }
            (ShaftDrive::SpeedRadS(omega), _) => omega,
            (ShaftDrive::Governed { .. }, None) => state.omega_p_rad_s,
        }
    }

    #[inline(always)]
    fn motor_kick(&self, omega: f64, inputs: &PlantInputs, dt: f64, torque: f64) -> f64 {
        let (j, friction) = (self.plant.motor_inertia_kg_m2, self.plant.motor_friction);
        match inputs.load {
            ShaftLoad::ResistiveNm(load) => shaft::kick(omega, dt, j, torque, friction, load),
            ShaftLoad::ConstantNm(load) => shaft::kick(omega, dt, j, torque - load, friction, 0.0),
            ShaftLoad::SpeedRadS(omega) => omega,
        }
    }

    /// Torques of the oil: sum of (p - p_c) * dV/dphi, dV/dphi = V_s/2 * alpha * sin(phi).
    #[inline(always)]
    fn torques(&self, state: &PlantState) -> (f64, f64) {
        let plant = self.plant;
        let (sin_p, cos_p) = state.phi_p_rad.sin_cos();
        let (sin_m, cos_m) = state.phi_m_rad.sin_cos();
        let (mut pump, mut motor) = (F64x4::ZERO, F64x4::ZERO);
        for g in 0..plant.groups.min(GROUPS) {
            let force = (state.p_chamber_pa[g] - F64x4::all(plant.case_pa)) * plant.half_stroke_m3[g];
            let (c, s) = (plant.cos_offset[g], plant.sin_offset[g]);
            pump += plant.is_pump[g] * force * (F64x4::all(sin_p) * c + F64x4::all(cos_p) * s);
            motor += (F64x4::all(1.0) - plant.is_pump[g])
                * force
                * (F64x4::all(sin_m) * c + F64x4::all(cos_m) * s);
        }
        (pump.sum() * state.alpha, motor.sum())
    }
}

/// Kinematics of a state.
fn kinematics(state: &PlantState) -> Kinematics {
    Kinematics {
        phi_p: state.phi_p_rad.rem_euclid(TAU),
        phi_m: state.phi_m_rad.rem_euclid(TAU),
        omega_p: state.omega_p_rad_s,
        omega_m: state.omega_m_rad_s,
        alpha: state.alpha,
    }
}
