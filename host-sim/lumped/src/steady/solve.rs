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

/// Pump speeds for which the model is valid.
pub const SPEED: ValueRange = ValueRange::new(10.0, 10_000.0, "r/min");
/// High pressures, gauge; the lower end is raised to 1 MPa above the low line, where the shuttle valve has a side.
pub const HIGH_PRESSURE: ValueRange = ValueRange::new(0.5, 120.0, "MPa");
/// Loads on the motor.
pub const LOAD: ValueRange = ValueRange::new(1.0, 1.0e6, "N m");
/// Steps as pump angle. Above 4 deg a step could jump over a silencing groove.
pub const STEP: ValueRange = ValueRange::new(0.001, 4.0, "deg");

impl SteadyPoint {
    /// Solves the steady state with default settings.
    ///
    /// # Errors
    /// Values out of range, a pressure or load that does not exist, or no convergence.
    pub fn solve(model: &LumpedModel, case: &SteadyCase) -> Result<Self, SimError> {
        Self::solve_with(model, case, &SolverSettings::default())
    }

    /// Solves the steady state.
    ///
    /// # Errors
    /// As [`SteadyPoint::solve`].
    pub fn solve_with(
        model: &LumpedModel,
        case: &SteadyCase,
        settings: &SolverSettings,
    ) -> Result<Self, SimError> {
        check(model, case, settings)?;
        let plant = model.plant(case.t_b_c, case.kou_l_min_mpa)?;
        RatioSearch::new(&plant, case, settings)?.solve().map(|(point, _)| point)
    }

    /// Solves the steady state; returns also a state on it and the inputs that hold it.
    ///
    /// # Errors
    /// As [`SteadyPoint::solve`].
    pub fn solve_state(
        plant: &Plant,
        model: &LumpedModel,
        case: &SteadyCase,
        settings: &SolverSettings,
    ) -> Result<(Self, PlantState, PlantInputs), SimError> {
        check(model, case, settings)?;
        let mut search = RatioSearch::new(plant, case, settings)?;
        let (point, state) = search.solve()?;
        Ok((point, state, search.inputs()))
    }
}

/// Checks conditions and settings against the ranges of the model and the machine.
fn check(model: &LumpedModel, case: &SteadyCase, settings: &SolverSettings) -> Result<(), SimError> {
    let low = model.machine().circuit().low_pressure_mpa;
    let range = |what: &str, value: f64, range: ValueRange| -> Result<(), SimError> {
        if range.contains(value) {
            return Ok(());
        }
        Err(InvalidInput::new(format!("{what} is out of range")).with_value(value).with_allowed(range).into())
    };
    range("pump speed", case.n_p_rpm, SPEED)?;
    range("displacement fraction", case.alpha, ValueRange::new(-1.0, 1.0, ""))?;
    range("size of the displacement fraction", case.alpha.abs(), ValueRange::new(0.01, 1.0, ""))?;
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
    match case.condition {
        LoadCondition::HighPressureMpa(p) => range(
            "high pressure",
            p,
            ValueRange::new(HIGH_PRESSURE.min.max(low + 1.0), HIGH_PRESSURE.max, "MPa"),
        ),
        LoadCondition::LoadNm(load) => range("load", load, LOAD),
    }
}
