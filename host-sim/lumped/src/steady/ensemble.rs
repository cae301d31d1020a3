//! Ensemble of runs with different relative positions of the two shafts, and its averages.
//!
//! Pump and motor ripple have different periods, so no state repeats exactly; a long transient averages over every
//! relative position of the shafts, and a single revolution is off by up to 1e-3 of ratio. Therefore several runs, the
//! members, have motors offset by a fraction of a piston pitch: their mean is free of every beat |k*Z_p - l*Z_m*r|
//! whose order l is no multiple of their number. The number is chosen so that the remaining beats are fast, and windows
//! of less than a revolution remove those. A single scout run precedes them and brings ratio and pressure close.

use std::f64::consts::TAU;
use std::ops::RangeInclusive;

use rayon::prelude::*;

use crate::averaging::{AveragingWindow, WindowMeans, WindowShape};
use crate::error::SimError;
use crate::integrator::Integrator;
use crate::layout::{LINE_A, LINE_B};
use crate::mass_balance::MassBalance;
use crate::plant::Plant;
use crate::plant_state::{PlantInputs, PlantState};
use crate::simd::WIDTH;
use crate::stepping::advance;
use crate::tableau::Method;

/// Numbers of members to choose from.
const MEMBERS: RangeInclusive<u32> = 5..=9;
/// Order of the pump's ripple up to which beats are considered. Orders 6 and 7 still move the ratio by 4e-5 at 36.5
/// MPa.
const BEAT_ORDER: u32 = 9;
/// Edges of the scout's window, pump revolutions: six pump ripples with nine pistons.
const SCOUT_EDGE_REV: f64 = 2.0 / 3.0;
/// Flat part of the scout's window.
const SCOUT_BOX_REV: f64 = 1.0 / 3.0;
/// Edges of a member's window in pump pitches: the shortest that remove the pump's ripple.
const EDGE_PITCHES: f64 = 3.0;
/// Longest flat part of a member's window in pump pitches.
const LONGEST_BOX_PITCHES: f64 = 4.0;
/// Start-up before the first window: a chamber's initial error vanishes at the next kidney.
const START_UP_REV: f64 = 0.5;
/// Cost of a coarse revolution relative to a measured one: its steps are longer.
const COARSE_COST: f64 = 0.4;
/// Transient after a correction of ratio and pressure.
const CORRECTION_REV: f64 = 0.25;

/// Result of one window over all runs.
#[derive(Debug, Clone, Copy)]
pub struct WindowResult {
    /// Means over all runs.
    pub means: WindowMeans,
    /// Largest peak-to-peak pressure of a line, by line.
    pub ripple_pa: [f64; 2],
}

/// Step size, in time and in steps per pump revolution.
#[derive(Debug, Clone, Copy)]
pub struct StepSize {
    /// Step, s.
    pub h_s: f64,
    /// Steps of one pump revolution.
    pub steps_per_rev: u64,
}

impl StepSize {
    /// Steps of about `step_deg` of pump angle that divide a revolution.
    pub fn new(step_deg: f64, omega_p: f64) -> Self {
        let steps = (360.0 / step_deg).ceil().max(1.0);
        Self { h_s: TAU / omega_p / steps, steps_per_rev: steps as u64 }
    }
}

/// Settings common to all runs: drive, method, steps, high line.
#[derive(Debug, Clone, Copy)]
pub struct EnsembleConfig<'a> {
    /// The drive.
    pub plant: &'a Plant,
    /// Method.
    pub method: Method,
    /// Step of measured windows.
    pub fine: StepSize,
    /// Step of start-up, transients and the scout run.
    pub coarse: StepSize,
    /// Line that is high.
    pub high: usize,
}

/// Member of the ensemble: integrator and state.
struct EnsembleMember<'a> {
    integrator: Integrator<'a>,
    state: PlantState,
    /// Mean high pressure of its last window.
    p_high_pa: f64,
}

/// The scout run, or the members.
pub struct Ensemble<'a> {
    config: EnsembleConfig<'a>,
    runs: Vec<EnsembleMember<'a>>,
    step: StepSize,
    shape: WindowShape,
    /// Pump revolutions simulated by all runs, the scout's included.
    pub revolutions: f64,
    /// Largest error of the mass balance over a window.
    pub worst_balance: f64,
}

impl<'a> Ensemble<'a> {
    /// Scout run after its start-up.
    pub fn scout(config: EnsembleConfig<'a>, inputs: &PlantInputs, p_high_pa: f64) -> Result<Self, SimError> {
        let step = config.coarse;
        let rev = step.steps_per_rev as f64;
        let shape = WindowShape { box_steps: SCOUT_BOX_REV * rev, edge_steps: SCOUT_EDGE_REV * rev };
        let mut runs = Self { config, runs: Vec::new(), step, shape, revolutions: 0.0, worst_balance: 0.0 };
        runs.start(&[0.0], inputs, p_high_pa)?;
        Ok(runs)
    }

    /// Distance of the motor's l-th harmonic from the pump's nearest one, per pump revolution.
    fn beat_per_rev(&self, ratio: f64, order: u32) -> f64 {
        let plant = self.config.plant;
        let (zp, zm) = (plant.pump_pistons as f64, plant.motor_pistons as f64 * ratio.abs());
        let motor = f64::from(order) * zm;
        let k = (motor / zp).round().clamp(1.0, f64::from(BEAT_ORDER));
        (k * zp - motor).abs()
    }

    /// Number of members and flat part of their window, in pump pitches: the cheapest whose slowest beat left is
    /// removed by that window, else the ones that leave the fastest. Beats of twice the order are weaker, so may be
    /// half as fast.
    fn members(&self, ratio: f64, from: RangeInclusive<u32>) -> (u32, f64) {
        let pitches = self.config.plant.pump_pistons as f64;
        let flat = |n: u32| {
            let left = self.beat_per_rev(ratio, n).min(2.0 * self.beat_per_rev(ratio, 2 * n));
            (pitches / left).ceil()
        };
        let cost =
            |n: u32, flat: f64| f64::from(n) * (START_UP_REV * COARSE_COST + (EDGE_PITCHES + flat) / pitches);
        let cheapest = |best: (u32, f64), (n, flat): (u32, f64)| match (best.1, flat) {
            (b, f) if f.max(b) > LONGEST_BOX_PITCHES => {
                if f < b {
                    (n, f)
                } else {
                    best
                }
            }
            (b, f) => {
                if cost(n, f) < cost(best.0, b) {
                    (n, f)
                } else {
                    best
                }
            }
        };
        let (n, flat) = from.map(|n| (n, flat(n))).fold((1, f64::INFINITY), cheapest);
        (n, flat.min(LONGEST_BOX_PITCHES))
    }

    /// Replaces the scout by members, the smallest sufficient number unless given, started at the wanted pressure.
    pub fn start_members(
        &mut self,
        members: Option<u32>,
        ratio: f64,
        inputs: &PlantInputs,
        p_high_pa: f64,
    ) -> Result<(), SimError> {
        let plant = self.config.plant;
        let (members, flat) = self.members(ratio, members.map_or(MEMBERS, |n| n..=n));
        let pump_pitches = plant.pump_pistons as f64;
        self.step = self.config.fine;
        let pitch_steps = self.step.steps_per_rev as f64 / pump_pitches;
        self.shape = WindowShape { box_steps: flat * pitch_steps, edge_steps: EDGE_PITCHES * pitch_steps };
        let spacing = TAU / (plant.motor_pistons as f64 * f64::from(members));
        let phases: Vec<f64> = (0..members).map(|k| spacing * f64::from(k)).collect();
        self.start(&phases, inputs, p_high_pa)
    }

    /// Prepares another window at a corrected ratio: sets the line to the wanted pressure and runs the transient.
    pub fn prepare_window(&mut self, inputs: &PlantInputs, target_pa: f64) -> Result<(), SimError> {
        let config = self.config;
        for run in &mut self.runs {
            shift_line_pressure(&config, &mut run.state, target_pa - run.p_high_pa);
        }
        self.run_transient(inputs, CORRECTION_REV)
    }

    /// Runs whose motors start at the given angles and whose high line starts at `p_high_pa`, after their start-up.
    fn start(&mut self, phases_rad: &[f64], inputs: &PlantInputs, p_high_pa: f64) -> Result<(), SimError> {
        let config = self.config;
        let pressure = |line: usize| if line == config.high { p_high_pa } else { config.plant.low_pa };
        let begin = |phi_m: &f64| {
            let mut integrator = Integrator::new(config.plant, config.method);
            let state = integrator.initial(pressure(LINE_A), pressure(LINE_B), inputs, inputs.alpha, *phi_m);
            EnsembleMember { integrator, state, p_high_pa }
        };
        self.runs = phases_rad.iter().map(begin).collect();
        self.run_transient(inputs, START_UP_REV)
    }

    /// Advances all runs by some revolutions at the coarse step.
    fn run_transient(&mut self, inputs: &PlantInputs, revolutions: f64) -> Result<(), SimError> {
        let StepSize { h_s: h, steps_per_rev } = self.config.coarse;
        let steps = (revolutions * steps_per_rev as f64).ceil() as u64;
        self.revolutions += self.runs.len() as f64 * steps as f64 / steps_per_rev as f64;
        let advance_one = |one: &mut EnsembleMember<'a>| {
            advance(&mut one.integrator, &mut one.state, inputs, h, steps, &mut ())
        };
        self.runs.par_iter_mut().try_for_each(advance_one)
    }

    /// One window of every run.
    pub fn window(&mut self, inputs: &PlantInputs) -> Result<WindowResult, SimError> {
        let (config, step, shape) = (self.config, self.step, self.shape);
        let one = |one: &mut EnsembleMember<'a>| -> Result<(WindowResult, f64), SimError> {
            let balance = MassBalance::from(&one.state, config.plant);
            let mut window = AveragingWindow::new(&one.state, shape);
            advance(&mut one.integrator, &mut one.state, inputs, step.h_s, shape.steps(), &mut window)?;
            let means = window.means();
            one.p_high_pa = means.p_node_pa[config.high];
            Ok((
                WindowResult { means, ripple_pa: window.ripple_pa() },
                balance.error(&one.state, config.plant),
            ))
        };
        let results: Vec<_> = self.runs.par_iter_mut().map(one).collect::<Result<_, _>>()?;
        self.revolutions += self.runs.len() as f64 * shape.steps() as f64 / step.steps_per_rev as f64;
        let mut all = WindowResult { means: WindowMeans::default(), ripple_pa: [0.0; 2] };
        for (one, balance) in &results {
            all.means.add(&one.means, 1.0 / results.len() as f64);
            for (largest, ripple) in all.ripple_pa.iter_mut().zip(one.ripple_pa) {
                *largest = largest.max(ripple);
            }
            self.worst_balance = self.worst_balance.max(*balance);
        }
        Ok(all)
    }

    /// State of the first member.
    pub fn into_state(mut self) -> PlantState {
        self.runs.swap_remove(0).state
    }
}

/// Volume that the pressure of the high line fills: the line and the chambers that are open to it, on average half of
/// them at half stroke.
pub fn high_volume_m3(plant: &Plant, high: usize) -> f64 {
    let at_half = |lane: usize| {
        let (g, l) = (lane / WIDTH, lane % WIDTH);
        plant.dead_m3[g].0[l] + plant.half_stroke_m3[g].0[l]
    };
    plant.node_m3[high] + 0.5 * (0..plant.chambers()).map(at_half).sum::<f64>()
}

/// Adds oil to the high line for a rise of pressure in it and in the chambers that are open to it.
fn shift_line_pressure(config: &EnsembleConfig<'_>, state: &mut PlantState, rise_pa: f64) {
    let (plant, high) = (config.plant, config.high);
    let rho = plant.oil.density_at(state.p_node_pa[high]);
    let rho_to = plant.oil.density_at(state.p_node_pa[high] + rise_pa);
    state.masses.node[high] += (rho_to - rho) * high_volume_m3(plant, high);
}
