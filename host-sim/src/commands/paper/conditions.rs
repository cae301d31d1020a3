//! Conditions of the paper's figures, and the solutions that several of them share.

use kou_lumped::transient::{StepResponse, swash_step};
use kou_lumped::{LoadCondition, LumpedModel, SolverSettings, SteadyCase, SteadyPoint};
use rayon::prelude::*;

use crate::commands::failure::Failure;

/// Speed and load of figures 7 and 8.
pub(super) const SPEED_RPM: f64 = 2000.0;
pub(super) const LOAD_NM: f64 = 1671.0;
/// Leakage that reproduces fig. 7, and the one that reproduces the losses of fig. 8.
pub(super) const KOU_STEP: f64 = 0.113;
pub(super) const KOU_LOSS: f64 = 0.101;
/// Leakage and speed of fig. 5; Kou is the one that the paper identifies near 1000 r/min.
pub(super) const KOU_RIPPLE: f64 = 0.058;
pub(super) const RIPPLE_RPM: f64 = 1000.0;
/// Oil temperature, degC.
pub(super) const T_B_C: f64 = 60.0;

/// Speed ratio without and with leakage at one pressure.
#[derive(Debug, Clone, Copy)]
pub(super) struct RatioRow {
    pub(super) p_h_mpa: f64,
    pub(super) leak_free: f64,
    pub(super) leaking: f64,
}

/// An operating point at full displacement.
pub(super) fn steady_case(condition: LoadCondition, n_p_rpm: f64, kou: f64) -> SteadyCase {
    SteadyCase { n_p_rpm, condition, t_b_c: T_B_C, alpha: 1.0, kou_l_min_mpa: kou }
}

/// Step response of fig. 7.
pub(super) fn step_response(model: &LumpedModel, kou: f64) -> Result<StepResponse, Failure> {
    let point = steady_case(LoadCondition::LoadNm(LOAD_NM), SPEED_RPM, kou);
    Ok(swash_step(model, &point, &SolverSettings::default(), 2.0)?)
}

/// Steady ratios of fig. 8, 10 to 50 MPa.
pub(super) fn ratio_rows(model: &LumpedModel) -> Result<Vec<RatioRow>, Failure> {
    let pressures: Vec<f64> = (0..=16).map(|k| 10.0 + 2.5 * f64::from(k)).collect();
    pressures
        .into_par_iter()
        .map(|p_h_mpa| {
            let ratio = |kou| {
                let point = steady_case(LoadCondition::HighPressureMpa(p_h_mpa), SPEED_RPM, kou);
                SteadyPoint::solve(model, &point).map(|steady| steady.ratio)
            };
            Ok(RatioRow { p_h_mpa, leak_free: ratio(0.0)?, leaking: ratio(KOU_LOSS)? })
        })
        .collect()
}
