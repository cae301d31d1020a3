//! Boundary conditions of a steady state.

use crate::operating_point::OperatingPoint;

/// Quantity held at the motor.
#[doc(alias = "boundary condition")]
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LoadCondition {
    /// Mean gauge pressure of the high line, as a bench's load machine holds it.
    HighPressureMpa(f64),
    /// Resistive torque on the motor's shaft.
    LoadNm(f64),
}

/// Boundary conditions of one steady state: imposed speed, load condition, oil temperature, displacement and leakage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SteadyCase {
    /// Pump speed.
    pub n_p_rpm: f64,
    /// High pressure or load.
    pub condition: LoadCondition,
    /// Oil temperature.
    pub t_b_c: f64,
    /// Displacement fraction of the pump.
    pub alpha: f64,
    /// Leakage coefficient of one chamber.
    pub kou_l_min_mpa: f64,
}

impl SteadyCase {
    /// Case with the operating point's high pressure held. Its low pressure is a result, not a condition.
    #[must_use]
    pub fn at(point: &OperatingPoint, kou_l_min_mpa: f64) -> Self {
        Self {
            n_p_rpm: point.n_p_rpm,
            condition: LoadCondition::HighPressureMpa(point.p_h_mpa),
            t_b_c: point.t_b_c,
            alpha: point.alpha,
            kou_l_min_mpa,
        }
    }
}
