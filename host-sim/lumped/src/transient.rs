//! Step response of the drive: swash from zero to a displacement, motor from rest against a resistive load
//! (paper fig. 7).

use std::f64::consts::TAU;

use crate::invalid_input::InvalidInput;
use crate::value_range::ValueRange;

use crate::error::SimError;
use crate::integrator::Integrator;
use crate::layout::LINE_A;
use crate::mass_balance::MassBalance;
use crate::model::LumpedModel;
use crate::plant_state::PlantInputs;
use crate::shaft::{ShaftDrive, ShaftLoad};
use crate::steady::{LoadCondition, SolverSettings, SteadyCase, SteadyPoint};
use crate::stepping::advance;

/// Simulated times of a step response.
pub const DURATION: ValueRange = ValueRange::new(0.01, 60.0, "s");
/// Settling band around the steady speed.
const BAND: f64 = 0.02;
/// Interval of the recorded trace.
const SAMPLE_S: f64 = 2.0e-4;
/// Crossings of the steady speed count only after the speed has left it by this fraction: ripple does not.
const CROSSING: f64 = 0.002;

/// Step response of the motor's speed.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct StepResponse {
    /// Motor speed in the steady state at this load.
    pub n_m_steady_rpm: f64,
    /// Highest speed above the steady one, percent of it.
    pub overshoot_pct: f64,
    /// Time after which the speed stays within 2 % of the steady one.
    pub settling_s: f64,
    /// Frequency of the oscillation about the steady speed; absent when it crosses less than three times.
    pub oscillation_hz: Option<f64>,
    /// |inflow - outflow - change of stored mass| over pumped mass.
    pub mass_balance_error: f64,
    /// Simulated time.
    pub sim_seconds: f64,
    /// Time, motor speed in r/min, gauge pressures of lines A and B in MPa.
    pub trace: Vec<[f64; 4]>,
}

/// Simulates a swash step at the case's load for `duration_s`.
///
/// # Errors
/// Values out of range, a load that the drive cannot turn, or a response outside the settling band at the end.
pub fn swash_step(
    model: &LumpedModel,
    case: &SteadyCase,
    settings: &SolverSettings,
    duration_s: f64,
) -> Result<StepResponse, SimError> {
    if !DURATION.contains(duration_s) {
        let error = InvalidInput::new("duration is out of range").with_value(duration_s);
        return Err(error.with_allowed(DURATION).into());
    }
    let LoadCondition::LoadNm(load) = case.condition else {
        return Err(InvalidInput::new("a step response needs a load, not a high pressure").into());
    };
    let steady = SteadyPoint::solve_with(model, case, settings)?;
    let n_m_steady_rpm = steady.ratio * case.n_p_rpm;
    let plant = model.plant(case.t_b_c, case.kou_l_min_mpa)?;
    let mut integrator = Integrator::new(&plant, settings.method);
    let omega_p = case.n_p_rpm / 60.0 * TAU;
    let inputs = PlantInputs {
        drive: ShaftDrive::SpeedRadS(omega_p),
        load: ShaftLoad::ResistiveNm(load),
        alpha: case.alpha,
    };
    let mut state = integrator.initial(plant.low_pa, plant.low_pa, &inputs, 0.0, 0.0);
    let balance = MassBalance::from(&state, &plant);
    let h = settings.step_deg.to_radians() / omega_p;
    let per_sample = (SAMPLE_S / h).ceil().max(1.0);
    let samples = (duration_s / (per_sample * h)).ceil() as u64;
    let mut trace = Vec::new();
    for _ in 0..samples {
        advance(&mut integrator, &mut state, &inputs, h, per_sample as u64, &mut ())?;
        let gauge = |p: f64| (p - super::oil::ATMOSPHERE_PA) * 1.0e-6;
        let n_m = state.omega_m_rad_s / TAU * 60.0;
        trace.push([state.time_s, n_m, gauge(state.p_node_pa[LINE_A]), gauge(state.p_node_pa[1 - LINE_A])]);
    }
    let relative = |n: f64| n / n_m_steady_rpm - 1.0;
    let settling_s = trace.iter().rev().find(|row| relative(row[1]).abs() > BAND).map_or(0.0, |row| row[0]);
    if settling_s >= 0.98 * state.time_s {
        let residual = trace.last().map_or(f64::INFINITY, |row| relative(row[1]).abs());
        return Err(SimError::NotSteady { revolutions: state.phi_p_rad / TAU, residual });
    }
    let highest = trace.iter().map(|row| relative(row[1])).fold(f64::NEG_INFINITY, f64::max);
    Ok(StepResponse {
        n_m_steady_rpm,
        overshoot_pct: 100.0 * highest.max(0.0),
        settling_s,
        oscillation_hz: oscillation(trace.iter().map(|row| (row[0], relative(row[1])))),
        mass_balance_error: balance.error(&state, &plant),
        sim_seconds: state.time_s,
        trace,
    })
}

/// Frequency from the crossings of zero between swings of at least [`CROSSING`] on alternating sides.
fn oscillation(deviation: impl Iterator<Item = (f64, f64)>) -> Option<f64> {
    let mut side = 0.0;
    let mut last_zero = 0.0;
    let mut before = -1.0;
    let mut crossings = Vec::new();
    for (t, x) in deviation {
        if x * before <= 0.0 {
            last_zero = t;
        }
        before = x;
        if x.abs() > CROSSING && x.signum() != side {
            if side != 0.0 {
                crossings.push(last_zero);
            }
            side = x.signum();
        }
    }
    match crossings.as_slice() {
        [first, .., last] if crossings.len() >= 3 => {
            Some(0.5 * (crossings.len() - 1) as f64 / (last - first))
        }
        _ => None,
    }
}
