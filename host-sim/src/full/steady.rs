//! The periodic steady state, found directly: speed ratio at a given high pressure or load, with its residual.
//!
//! Both shafts turn at imposed speeds, and the motor's speed is corrected until the high line neither fills nor empties
//! at the wanted mean pressure. From one window, with mean pressure P, mean rate M' of the line's mass and mean motor
//! torque T,
//!
//! ```text
//! p_H    = P + (T_load - T)/(D_m/2 pi)         where the load is given, not the pressure
//! r      = r + M'/(mu*omega_p) + dr/dp*(p_H - P)
//! ```
//!
//! with mu the oil that the motor takes per radian and dr/dp from the start estimate; then the line is moved to p_H.
//! One correction leaves 10 to 30 % of an error, so the residual, the last change of the ratio, bounds what is left.
//!
//! Pump and motor ripple have different periods, so no state repeats exactly; what a long transient averages over is
//! every relative position of the two shafts, and one revolution alone is off by up to 1e-3. One short window first brings
//! pressure and ratio close. The next ones span a whole beat, the slowest |k*Z_p - l*Z_m*r| per revolution with small
//! k and l; where that takes too long (r near Z_p/Z_m, 4/5 of it and the like), [`MEMBERS`] runs with motors a fraction of
//! a piston pitch apart take its place, each with short windows, and their means are averaged.

use std::f64::consts::TAU;

use crate::input::{InputError, Range};

use super::error::SimError;
use super::hydraulics::{LEAK_MOTOR, LEAK_PUMP};
use super::integrator::{Inputs, Integrator, State};
use super::observers::{MassBalance, Means, Shape, Window};
use super::oil::ATMOSPHERE_PA;
use super::plant::{A, B, Model, Plant};
use super::run::run;
use super::shaft::{Drive, Load};
use super::tableau::Method;

/// Runs with different relative positions of the shafts where a beat is slow. Being prime, the number averages out every
/// beat whose order l it does not divide.
pub const MEMBERS: usize = 7;
/// Slowest beat, in pump revolutions, that is waited for; a longer window costs more than [`MEMBERS`] short ones.
const LONGEST_BEAT_REV: f64 = 4.0;
/// Rise and fall of a window, pump revolutions: six pump ripples with nine pistons.
const EDGE_REV: f64 = 2.0 / 3.0;
/// Flat part of a window that need not span a beat.
const SHORT_BOX_REV: f64 = 1.0 / 3.0;
/// Flat part of a window that spans beats: whole beats, at least this long, so that beats of high order average out too.
const LONG_BOX_REV: f64 = 1.5;
/// Start-up before the first window: chambers forget a wrong start when they next meet a kidney.
const SETTLE_REV: f64 = 0.5;
/// Pump speeds for which the model is meant.
pub const SPEED: Range = Range::new(10.0, 10_000.0, "r/min");
/// High pressures, gauge; the lower end is raised to 1 MPa above the low line, where the shuttle valve has a side.
pub const HIGH_PRESSURE: Range = Range::new(0.5, 120.0, "MPa");
/// Loads on the motor.
pub const LOAD: Range = Range::new(1.0, 1.0e6, "N m");
/// Steps as pump angle. Above 4 deg a step could jump over a silencing groove.
pub const STEP: Range = Range::new(0.001, 4.0, "deg");
/// Windows after which the search gives up.
const MAX_WINDOWS: u32 = 14;
/// Windows after which a single run gives way to several: a beat of high order keeps it from settling.
const MAX_SINGLE: u32 = 5;
/// Fraction of the tolerance that may be left by extrapolation when the last change itself is above the tolerance.
const FORESEEN: f64 = 0.4;
/// Corrections of the last windows that are averaged when no single one was small enough.
const AVERAGED: usize = 4;
/// Spread of those corrected ratios at which their mean still is a result, with the spread as its residual.
const SPREAD: f64 = 1.0e-4;
/// Corrections below this are not taken from a short window: the beat that it does not see is of this size.
const SHORT_NOISE: f64 = 1.0e-3;
/// Orders k and l up to which beats are looked for. A beat of orders 4 and 5 still moves the ratio by 9e-5 at 50 MPa.
const BEAT_ORDER: u32 = 6;
/// Fraction of theory's leakage that a start estimate expects: chambers in transition leak less.
const LEAKING: f64 = 0.96;

/// What is held at the motor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Held {
    /// Mean gauge pressure of the high line, as a bench's load machine holds it.
    HighPressureMpa(f64),
    /// Resistive torque on the motor's shaft.
    LoadNm(f64),
}

/// One steady operating point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Operating {
    /// Pump speed.
    pub n_p_rpm: f64,
    /// High pressure or load.
    pub held: Held,
    /// Oil temperature.
    pub t_b_c: f64,
    /// Displacement fraction.
    pub alpha: f64,
    /// Leakage coefficient of one chamber.
    pub kou_l_min_mpa: f64,
}

/// How finely to compute.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Step as pump angle.
    pub step_deg: f64,
    /// Method.
    pub method: Method,
    /// Last change of the ratio at which the search ends; the error left is about a third of it.
    pub tolerance: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self { step_deg: 0.75, method: Method::TrBdf2, tolerance: 1.0e-5 }
    }
}

/// A steady operating point.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct SteadyPoint {
    /// Speed ratio n_m/n_p.
    pub ratio: f64,
    /// Last change of the ratio in the search.
    pub residual: f64,
    /// Mean high pressure, gauge.
    pub p_h_mpa: f64,
    /// Mean low pressure, gauge.
    pub p_l_mpa: f64,
    /// Mean torque of the oil on the motor, friction not yet taken off.
    pub torque_nm: f64,
    /// Mean torque that the oil takes from the pump's shaft.
    pub pump_torque_nm: f64,
    /// Leakage of all chambers, as volume at case pressure.
    pub leakage_l_min: f64,
    /// Peak to peak of the high pressure.
    pub ripple_p_h_mpa: f64,
    /// |inflow - outflow - change of stored mass| over pumped mass, largest of all windows.
    pub mass_balance_error: f64,
    /// Simulated time, all runs together.
    pub sim_seconds: f64,
    /// Pump revolutions simulated, all runs together.
    pub revolutions: f64,
}

impl SteadyPoint {
    /// Finds the steady state with default settings.
    ///
    /// # Errors
    /// Values out of range, a pressure or load that does not exist, or no convergence.
    pub fn solve(model: &Model, operating: &Operating) -> Result<Self, SimError> {
        Self::solve_with(model, operating, &Settings::default())
    }

    /// Finds the steady state.
    ///
    /// # Errors
    /// As [`SteadyPoint::solve`].
    pub fn solve_with(model: &Model, operating: &Operating, settings: &Settings) -> Result<Self, SimError> {
        check(model, operating, settings)?;
        let plant = model.plant(operating.t_b_c, operating.kou_l_min_mpa)?;
        Search::new(&plant, operating, settings)?.solve().map(|(point, _)| point)
    }

    /// Finds the steady state and hands back a state on it as well, with the inputs that keep it there.
    ///
    /// # Errors
    /// As [`SteadyPoint::solve`].
    pub fn solve_state(
        plant: &Plant,
        model: &Model,
        operating: &Operating,
        settings: &Settings,
    ) -> Result<(Self, State, Inputs), SimError> {
        check(model, operating, settings)?;
        let mut search = Search::new(plant, operating, settings)?;
        let (point, state) = search.solve()?;
        Ok((point, state, search.inputs()))
    }
}

/// Checks an operating point against the ranges of the model and the machine.
fn check(model: &Model, operating: &Operating, settings: &Settings) -> Result<(), SimError> {
    let low = model.machine().circuit().low_pressure_mpa;
    let range = |what: &str, value: f64, range: Range| -> Result<(), SimError> {
        if range.contains(value) {
            return Ok(());
        }
        Err(InputError::new(format!("{what} is out of range")).with_value(value).with_allowed(range).into())
    };
    range("pump speed", operating.n_p_rpm, SPEED)?;
    range("displacement fraction", operating.alpha, Range::new(-1.0, 1.0, ""))?;
    range("size of the displacement fraction", operating.alpha.abs(), Range::new(0.01, 1.0, ""))?;
    range("step size", settings.step_deg, STEP)?;
    range("tolerance of the ratio", settings.tolerance, Range::new(1.0e-9, 1.0e-2, ""))?;
    match operating.held {
        Held::HighPressureMpa(p) => {
            range("high pressure", p, Range::new(HIGH_PRESSURE.min.max(low + 1.0), HIGH_PRESSURE.max, "MPa"))
        }
        Held::LoadNm(load) => range("load", load, LOAD),
    }
}

/// One run: its integrator and state.
type Runner<'a> = (Integrator<'a>, State);

struct Search<'a> {
    plant: &'a Plant,
    operating: Operating,
    settings: Settings,
    omega_p: f64,
    /// Line that is high, and the other.
    high: usize,
    low: usize,
    h: f64,
    steps_per_rev: u64,
    ratio: f64,
    target_pa: f64,
    ratio_per_pa: f64,
    sim_seconds: f64,
    revolutions: f64,
    worst_balance: f64,
}

impl<'a> Search<'a> {
    fn new(plant: &'a Plant, operating: &Operating, settings: &Settings) -> Result<Self, SimError> {
        let omega_p = operating.n_p_rpm / 60.0 * TAU;
        let steps_per_rev = (360.0 / settings.step_deg).ceil().max(1.0);
        let forward = operating.alpha > 0.0;
        let target_pa = match operating.held {
            Held::HighPressureMpa(p) => p * 1.0e6 + ATMOSPHERE_PA,
            Held::LoadNm(load) => plant.low_pa + plant.needed_torque(load, omega_p) / plant.motor_m3_per_rad,
        };
        let mut search = Self {
            plant,
            operating: *operating,
            settings: *settings,
            omega_p,
            high: if forward { A } else { B },
            low: if forward { B } else { A },
            h: TAU / omega_p / steps_per_rev,
            steps_per_rev: steps_per_rev as u64,
            ratio: 0.0,
            target_pa,
            ratio_per_pa: 0.0,
            sim_seconds: 0.0,
            revolutions: 0.0,
            worst_balance: 0.0,
        };
        search.ratio = search.estimate(target_pa);
        search.ratio_per_pa =
            (search.estimate(target_pa + 1.0e5) - search.estimate(target_pa - 1.0e5)) / 2.0e5;
        search.demand_flow()?;
        Ok(search)
    }

    /// Ratio by the volumes alone: where the search begins; has no influence on where it ends.
    fn estimate(&self, p_pa: f64) -> f64 {
        let (plant, alpha) = (self.plant, self.operating.alpha.abs());
        let rho = (plant.oil.density_at(p_pa), plant.oil.density_at(plant.low_pa));
        let squeeze = 1.0 - rho.1 / rho.0;
        let dead = |from: usize, pistons: usize| -> f64 {
            (from..from + pistons).map(|i| plant.dead_m3[i / 4].0[i % 4]).sum::<f64>() / TAU
        };
        let (pump, motor) = (plant.pump_m3_per_rad, plant.motor_m3_per_rad);
        let pump_dead = dead(0, plant.pump_pistons) + 0.5 * (1.0 - alpha) * pump;
        let leak: f64 =
            plant.kou_m3_s_pa.iter().map(|v| v.sum()).sum::<f64>() * 0.5 * LEAKING * (p_pa - plant.case_pa);
        let flow = alpha * pump - (alpha * pump + pump_dead) * squeeze - leak / self.omega_p;
        self.operating.alpha.signum() * flow
            / (motor + dead(plant.pump_pistons, plant.motor_pistons) * squeeze)
    }

    /// Refuses a point at which nothing is left for the motor.
    fn demand_flow(&self) -> Result<(), SimError> {
        if self.ratio * self.operating.alpha.signum() > 1.0e-3 {
            return Ok(());
        }
        let wanted = match self.operating.held {
            Held::HighPressureMpa(p) => format!("high pressure of {p} MPa"),
            Held::LoadNm(load) => format!("load of {load} N m"),
        };
        let reason = format!(
            "at {} r/min, displacement {} and Kou {} (L/min)/MPa compression and leakage take the pump's whole flow",
            self.operating.n_p_rpm, self.operating.alpha, self.operating.kou_l_min_mpa
        );
        Err(SimError::Unreachable { wanted, reason })
    }

    fn inputs(&self) -> Inputs {
        Inputs {
            drive: Drive::SpeedRadS(self.omega_p),
            load: Load::SpeedRadS(self.ratio * self.omega_p),
            alpha: self.operating.alpha,
        }
    }

    fn solve(&mut self) -> Result<(SteadyPoint, State), SimError> {
        let short = Shape {
            box_steps: SHORT_BOX_REV * self.steps_per_rev as f64,
            edge_steps: EDGE_REV * self.steps_per_rev as f64,
        };
        let mut runners = vec![self.start(0.0, self.target_pa)?];
        let mut shape = short;
        let mut before = self.ratio;
        let mut change = f64::INFINITY;
        let mut corrected = Vec::new();
        for window in 0..MAX_WINDOWS {
            let (means, pressures_pa, ripple_pa) = self.windows(&mut runners, shape)?;
            let last_change = change;
            change = self.correct(&means)?;
            // Corrections that shrink by q leave change*q/(1 - q): as good as one more window when that is small.
            let q = change / last_change;
            let left = if window > 1 && q < 0.5 { change * q / (1.0 - q) } else { f64::INFINITY };
            if window > 0 && (change < self.settings.tolerance || left < FORESEEN * self.settings.tolerance) {
                let point = self.point(&means, ripple_pa, change);
                return Ok((point, runners.swap_remove(0).1));
            }
            corrected.push(self.ratio);
            if window + 1 == MAX_WINDOWS {
                let last = corrected.split_off(corrected.len().saturating_sub(AVERAGED));
                let highest = last.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                let spread = highest - last.iter().copied().fold(f64::INFINITY, f64::min);
                if spread < SPREAD {
                    self.ratio = last.iter().sum::<f64>() / last.len() as f64;
                    return Ok((self.point(&means, ripple_pa, spread), runners.swap_remove(0).1));
                }
            }
            if window == 0 && change < SHORT_NOISE {
                self.ratio = before;
            }
            before = self.ratio;
            for ((_, state), pressure_pa) in runners.iter_mut().zip(pressures_pa) {
                self.move_line(state, self.target_pa - pressure_pa);
            }
            let beat = self.slowest_beat_per_rev();
            if runners.len() == MEMBERS {
                // Once there are members they stay, also when the ratio wanders off the slow beat.
                continue;
            }
            if beat * LONGEST_BEAT_REV > 1.0 && window < MAX_SINGLE {
                let box_steps = (LONG_BOX_REV * beat).ceil() / beat * self.steps_per_rev as f64;
                shape = Shape { box_steps, ..short };
            } else {
                // All start afresh and together, so that their phases stay evenly spread.
                shape = short;
                let pitch = TAU / self.plant.motor_pistons as f64;
                let phases = (0..MEMBERS).map(|k| pitch * k as f64 / MEMBERS as f64);
                runners = phases.map(|phase| self.start(phase, self.target_pa)).collect::<Result<_, _>>()?;
            }
        }
        Err(SimError::NotSteady { revolutions: self.revolutions, residual: change })
    }

    /// The slowest beat |k*Z_p - l*Z_m*r| of pump and motor ripple, per pump revolution.
    fn slowest_beat_per_rev(&self) -> f64 {
        let (zp, zm) = (self.plant.pump_pistons as f64, self.plant.motor_pistons as f64 * self.ratio.abs());
        let orders =
            (1..=BEAT_ORDER).flat_map(|k| (1..=BEAT_ORDER).map(move |l| (f64::from(k), f64::from(l))));
        orders.map(|(k, l)| (k * zp - l * zm).abs()).fold(f64::INFINITY, f64::min)
    }

    /// A run whose motor starts at angle `phi_m` and whose high line starts at `p_high_pa`, settled.
    fn start(&mut self, phi_m: f64, p_high_pa: f64) -> Result<Runner<'a>, SimError> {
        let inputs = self.inputs();
        let mut integrator = Integrator::new(self.plant, self.settings.method);
        let pressure = |line: usize| if line == self.high { p_high_pa } else { self.plant.low_pa };
        let mut state = integrator.initial(pressure(A), pressure(B), &inputs, self.operating.alpha, phi_m);
        let steps = (SETTLE_REV * self.steps_per_rev as f64).ceil() as u64;
        run(&mut integrator, &mut state, &inputs, self.h, steps, &mut ())?;
        self.count(steps);
        Ok((integrator, state))
    }

    /// One window of every run: average of their means, each one's high pressure, and the largest ripple.
    fn windows(
        &mut self,
        runners: &mut [Runner<'a>],
        shape: Shape,
    ) -> Result<(Means, Vec<f64>, f64), SimError> {
        let mut sum = Means::default();
        let mut pressures_pa = Vec::with_capacity(runners.len());
        let mut ripple: f64 = 0.0;
        let share = 1.0 / runners.len() as f64;
        for runner in runners {
            let (means, one_ripple) = self.window(runner, shape)?;
            pressures_pa.push(means.p_node_pa[self.high]);
            sum.add(&means, share);
            ripple = ripple.max(one_ripple);
        }
        Ok((sum, pressures_pa, ripple))
    }

    /// Corrects ratio and target pressure after a window; returns the change of the ratio.
    fn correct(&mut self, means: &Means) -> Result<f64, SimError> {
        let plant = self.plant;
        let mean_pa = means.p_node_pa[self.high];
        // Oil that the motor takes per radian: what it displaces, at the line's density.
        let mu = plant.motor_m3_per_rad * plant.oil.density_at(mean_pa);
        let sign = self.operating.alpha.signum();
        if let Held::LoadNm(load) = self.operating.held {
            let lacking = plant.needed_torque(load, self.ratio * self.omega_p) - sign * means.torque_m_nm;
            self.target_pa = mean_pa + lacking / plant.motor_m3_per_rad;
        }
        let change = sign * means.node_kg_s[self.high] / (mu * self.omega_p)
            + self.ratio_per_pa * (self.target_pa - mean_pa);
        self.ratio += change;
        self.demand_flow()?;
        Ok(change.abs())
    }

    fn count(&mut self, steps: u64) {
        self.sim_seconds += steps as f64 * self.h;
        self.revolutions += steps as f64 / self.steps_per_rev as f64;
    }

    /// One window of one run: its means and the ripple of the high line.
    fn window(&mut self, runner: &mut Runner<'a>, shape: Shape) -> Result<(Means, f64), SimError> {
        let (integrator, state) = runner;
        let inputs = self.inputs();
        let account = MassBalance::open(state, self.plant);
        let mut window = Window::new(state, shape);
        run(integrator, state, &inputs, self.h, shape.steps(), &mut window)?;
        self.worst_balance = self.worst_balance.max(account.error(state, self.plant));
        self.count(shape.steps());
        Ok((window.means(), window.ripple_pa()[self.high]))
    }

    /// Adds oil to the high line for a rise of pressure in it and in the chambers that are open to it.
    fn move_line(&self, state: &mut State, rise_pa: f64) {
        let plant = self.plant;
        let volume = plant.node_m3[self.high] + 0.5 * TAU * (plant.pump_m3_per_rad + plant.motor_m3_per_rad);
        let rho = plant.oil.density_at(state.p_node_pa[self.high]);
        let rho_to = plant.oil.density_at(state.p_node_pa[self.high] + rise_pa);
        state.masses.node[self.high] += (rho_to - rho) * volume;
    }

    /// The result at the wanted pressure: means of the last window, moved by the little that the window was off it.
    fn point(&self, means: &Means, ripple_pa: f64, residual: f64) -> SteadyPoint {
        let gauge = |p: f64| (p - ATMOSPHERE_PA) * 1.0e-6;
        let leak_kg_s = means.flow_kg_s[LEAK_PUMP] + means.flow_kg_s[LEAK_MOTOR];
        let sign = self.operating.alpha.signum();
        let off_pa = self.target_pa - means.p_node_pa[self.high];
        SteadyPoint {
            ratio: self.ratio,
            residual,
            p_h_mpa: gauge(self.target_pa),
            p_l_mpa: gauge(means.p_node_pa[self.low]),
            torque_nm: sign * means.torque_m_nm + off_pa * self.plant.motor_m3_per_rad,
            pump_torque_nm: -means.torque_p_nm
                + off_pa * self.operating.alpha.abs() * self.plant.pump_m3_per_rad,
            leakage_l_min: leak_kg_s / self.plant.case_rho * 60_000.0,
            ripple_p_h_mpa: ripple_pa * 1.0e-6,
            mass_balance_error: self.worst_balance,
            sim_seconds: self.sim_seconds,
            revolutions: self.revolutions,
        }
    }
}

impl Plant {
    /// Torque that the oil must give for a load at a speed: load and friction.
    fn needed_torque(&self, load_nm: f64, omega_m: f64) -> f64 {
        load_nm + self.motor_friction.coulomb_nm + self.motor_friction.viscous_nm_s * omega_m.abs()
    }
}
