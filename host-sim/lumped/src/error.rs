//! Errors of the model: invalid input, no convergence, no steady state.

use crate::invalid_input::InvalidInput;

/// Error of a simulation.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SimError {
    /// Invalid machine file or operating point.
    #[error("{0}")]
    Input(#[from] InvalidInput),
    /// Newton's method did not converge on the implicit equations of a step, even after halving it.
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
    /// Pressure beyond the oil table.
    #[error(
        "pressure of {pressure_mpa:.1} MPa in {place} at {time_s:.6} s is beyond the {limit_mpa:.0} MPa of the oil \
             table: the pump's flow has no outlet"
    )]
    PressureTooHigh {
        /// Line.
        place: &'static str,
        /// Simulated time.
        time_s: f64,
        /// Pressure, gauge.
        pressure_mpa: f64,
        /// Limit, gauge.
        limit_mpa: f64,
    },
    /// Pressure or load at which no steady state exists.
    #[error("{wanted} cannot be reached: {reason}")]
    Unreachable {
        /// Requested quantity with value and unit.
        wanted: String,
        /// Cause.
        reason: String,
    },
    /// Search for the steady state stopped at its limit of windows.
    #[error(
        "no steady state after {revolutions:.0} pump revolutions: the ratio still changes by {residual:.1e}"
    )]
    NotSteady {
        /// Pump revolutions simulated.
        revolutions: f64,
        /// Residual of the ratio at that point.
        residual: f64,
    },
    /// Result file that cannot be written.
    #[error("{0}")]
    Output(String),
}
