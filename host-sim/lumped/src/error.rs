//! Why a simulation cannot start or cannot go on; every variant names the cause and the value.

use crate::invalid_input::InvalidInput;

/// Failure of the full model.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SimError {
    /// The machine file or a value of the command line is not usable.
    #[error("{0}")]
    Input(#[from] InvalidInput),
    /// The implicit equations of one step had no solution that Newton's method could find, even after halving the step.
    #[error(
        "did not converge at {time_s:.6} s with a step of {step_s:.1e} s: last mass change {last_change:.1e} of a \
             chamber's content in {iterations} iterations"
    )]
    NotConverged {
        /// Simulated time.
        time_s: f64,
        /// Smallest step that was tried.
        step_s: f64,
        /// Size of the last Newton update, relative.
        last_change: f64,
        /// Newton iterations made.
        iterations: u32,
    },
    /// A pressure left the range for which the oil is tabulated.
    #[error(
        "pressure of {pressure_mpa:.1} MPa in {place} at {time_s:.6} s is beyond the {limit_mpa:.0} MPa of the oil \
             table: the pump has no way out for its flow"
    )]
    PressureTooHigh {
        /// Where.
        place: &'static str,
        /// Simulated time.
        time_s: f64,
        /// Pressure, gauge.
        pressure_mpa: f64,
        /// Limit, gauge.
        limit_mpa: f64,
    },
    /// No steady state exists with the wanted pressure or load.
    #[error("{wanted} cannot be reached: {reason}")]
    Unreachable {
        /// What was asked for, with value and unit.
        wanted: String,
        /// Why it does not exist.
        reason: String,
    },
    /// The search for the steady state stopped at its limit of work.
    #[error(
        "no steady state after {revolutions:.0} pump revolutions: the ratio still changes by {residual:.1e}"
    )]
    NotSteady {
        /// Pump revolutions simulated.
        revolutions: f64,
        /// Residual of the ratio at that point.
        residual: f64,
    },
    /// A result file could not be written.
    #[error("{0}")]
    Output(String),
}
