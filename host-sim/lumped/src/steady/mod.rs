//! The periodic steady state, found directly: speed ratio at a given high pressure or load, with its residual.
//!
//! Here is what is asked and what is answered; `search` corrects the ratio until the high line neither fills nor
//! empties, `runs` averages over the relative positions of the two shafts. docs/full-model/steady.md derives both.

mod case;
mod runs;
mod search;

use crate::input::{InvalidInput, Range};

use super::error::SimError;
use super::integrator::{Inputs, State};
use super::plant::{Model, Plant};
use super::tableau::Method;

pub use case::{LoadCondition, SteadyCase};
use search::Search;

/// Pump speeds for which the model is meant.
pub const SPEED: Range = Range::new(10.0, 10_000.0, "r/min");
/// High pressures, gauge; the lower end is raised to 1 MPa above the low line, where the shuttle valve has a side.
pub const HIGH_PRESSURE: Range = Range::new(0.5, 120.0, "MPa");
/// Loads on the motor.
pub const LOAD: Range = Range::new(1.0, 1.0e6, "N m");
/// Steps as pump angle. Above 4 deg a step could jump over a silencing groove.
pub const STEP: Range = Range::new(0.001, 4.0, "deg");

/// Windows of the members after which the search gives up.
const MAX_WINDOWS: u32 = 10;

/// How finely to compute.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Step as pump angle.
    pub step_deg: f64,
    /// Method.
    pub method: Method,
    /// Uncertainty of the ratio at which the search ends.
    pub tolerance: f64,
    /// Relative positions of the two shafts to average over; `None` takes as few as will do. 1 to 64.
    pub members: Option<u32>,
    /// Windows to average over at least, once corrections have become small. 1 to 10.
    pub windows: u32,
}

impl Default for Settings {
    fn default() -> Self {
        Self { step_deg: 0.75, method: Method::TrBdf2, tolerance: 1.0e-5, members: None, windows: 1 }
    }
}

/// A steady operating point.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct SteadyPoint {
    /// Speed ratio n_m/n_p.
    pub ratio: f64,
    /// What the ratio is uncertain by: the last change of its running mean, or the spread of the last windows.
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
    pub fn solve(model: &Model, operating: &SteadyCase) -> Result<Self, SimError> {
        Self::solve_with(model, operating, &Settings::default())
    }

    /// Finds the steady state.
    ///
    /// # Errors
    /// As [`SteadyPoint::solve`].
    pub fn solve_with(model: &Model, operating: &SteadyCase, settings: &Settings) -> Result<Self, SimError> {
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
        operating: &SteadyCase,
        settings: &Settings,
    ) -> Result<(Self, State, Inputs), SimError> {
        check(model, operating, settings)?;
        let mut search = Search::new(plant, operating, settings)?;
        let (point, state) = search.solve()?;
        Ok((point, state, search.inputs()))
    }
}

/// Checks an operating point against the ranges of the model and the machine.
fn check(model: &Model, operating: &SteadyCase, settings: &Settings) -> Result<(), SimError> {
    let low = model.machine().circuit().low_pressure_mpa;
    let range = |what: &str, value: f64, range: Range| -> Result<(), SimError> {
        if range.contains(value) {
            return Ok(());
        }
        Err(InvalidInput::new(format!("{what} is out of range")).with_value(value).with_allowed(range).into())
    };
    range("pump speed", operating.n_p_rpm, SPEED)?;
    range("displacement fraction", operating.alpha, Range::new(-1.0, 1.0, ""))?;
    range("size of the displacement fraction", operating.alpha.abs(), Range::new(0.01, 1.0, ""))?;
    range("step size", settings.step_deg, STEP)?;
    range("tolerance of the ratio", settings.tolerance, Range::new(1.0e-9, 1.0e-2, ""))?;
    range("number of shaft positions", settings.members.map_or(1.0, f64::from), Range::new(1.0, 64.0, ""))?;
    range("number of windows", f64::from(settings.windows), Range::new(1.0, f64::from(MAX_WINDOWS), ""))?;
    match operating.condition {
        LoadCondition::HighPressureMpa(p) => {
            range("high pressure", p, Range::new(HIGH_PRESSURE.min.max(low + 1.0), HIGH_PRESSURE.max, "MPa"))
        }
        LoadCondition::LoadNm(load) => range("load", load, LOAD),
    }
}
