//! Solution of the steady state: checks of the conditions, then the search for the ratio.

use crate::error::SimError;
use crate::invalid_input::InvalidInput;
use crate::model::LumpedModel;
use crate::plant::Plant;
use crate::plant_state::{PlantInputs, PlantState};
use crate::value_range::ValueRange;

use super::case::{LoadCondition, SteadyCase};
use super::point::SteadyPoint;
use super::ratio_search::RatioSearch;
use super::settings::{MAX_WINDOWS, SolverSettings};

/// Pump speeds for which the model is meant.
pub const SPEED: ValueRange = ValueRange::new(10.0, 10_000.0, "r/min");
/// High pressures, gauge; the lower end is raised to 1 MPa above the low line, where the shuttle valve has a side.
pub const HIGH_PRESSURE: ValueRange = ValueRange::new(0.5, 120.0, "MPa");
/// Loads on the motor.
pub const LOAD: ValueRange = ValueRange::new(1.0, 1.0e6, "N m");
/// Steps as pump angle. Above 4 deg a step could jump over a silencing groove.
pub const STEP: ValueRange = ValueRange::new(0.001, 4.0, "deg");

impl SteadyPoint {
    /// Finds the steady state with default settings.
    ///
    /// # Errors
    /// Values out of range, a pressure or load that does not exist, or no convergence.
    pub fn solve(model: &LumpedModel, operating: &SteadyCase) -> Result<Self, SimError> {
        Self::solve_with(model, operating, &SolverSettings::default())
    }

    /// Finds the steady state.
    ///
    /// # Errors
    /// As [`SteadyPoint::solve`].
    pub fn solve_with(
        model: &LumpedModel,
        operating: &SteadyCase,
        settings: &SolverSettings,
    ) -> Result<Self, SimError> {
        check(model, operating, settings)?;
        let plant = model.plant(operating.t_b_c, operating.kou_l_min_mpa)?;
        RatioSearch::new(&plant, operating, settings)?.solve().map(|(point, _)| point)
    }

    /// Finds the steady state and hands back a state on it as well, with the inputs that keep it there.
    ///
    /// # Errors
    /// As [`SteadyPoint::solve`].
    pub fn solve_state(
        plant: &Plant,
        model: &LumpedModel,
        operating: &SteadyCase,
        settings: &SolverSettings,
    ) -> Result<(Self, PlantState, PlantInputs), SimError> {
        check(model, operating, settings)?;
        let mut search = RatioSearch::new(plant, operating, settings)?;
        let (point, state) = search.solve()?;
        Ok((point, state, search.inputs()))
    }
}

/// Checks an operating point against the ranges of the model and the machine.
fn check(model: &LumpedModel, operating: &SteadyCase, settings: &SolverSettings) -> Result<(), SimError> {
    let low = model.machine().circuit().low_pressure_mpa;
    let range = |what: &str, value: f64, range: ValueRange| -> Result<(), SimError> {
        if range.contains(value) {
            return Ok(());
        }
        Err(InvalidInput::new(format!("{what} is out of range")).with_value(value).with_allowed(range).into())
    };
    range("pump speed", operating.n_p_rpm, SPEED)?;
    range("displacement fraction", operating.alpha, ValueRange::new(-1.0, 1.0, ""))?;
    range("size of the displacement fraction", operating.alpha.abs(), ValueRange::new(0.01, 1.0, ""))?;
    range("step size", settings.step_deg, STEP)?;
    range("tolerance of the ratio", settings.tolerance, ValueRange::new(1.0e-9, 1.0e-2, ""))?;
    range(
        "number of shaft positions",
        settings.members.map_or(1.0, f64::from),
        ValueRange::new(1.0, 64.0, ""),
    )?;
    range(
        "number of windows",
        f64::from(settings.windows),
        ValueRange::new(1.0, f64::from(MAX_WINDOWS), ""),
    )?;
    match operating.condition {
        LoadCondition::HighPressureMpa(p) => range(
            "high pressure",
            p,
            ValueRange::new(HIGH_PRESSURE.min.max(low + 1.0), HIGH_PRESSURE.max, "MPa"),
        ),
        LoadCondition::LoadNm(load) => range("load", load, LOAD),
    }
}
