//! Settings of the steady-state solver.

use crate::tableau::Method;

/// Windows of the members after which the search stops without a result.
pub(super) const MAX_WINDOWS: u32 = 10;

/// Step, method and tolerance of the steady-state solver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SolverSettings {
    /// Step as pump angle.
    pub step_deg: f64,
    /// Method.
    pub method: Method,
    /// Residual of the ratio at which the search ends.
    pub tolerance: f64,
    /// Relative positions of the two shafts to average over, 1 to 64; `None` selects the smallest sufficient number.
    pub members: Option<u32>,
    /// Least number of windows to average over once corrections have become small, 1 to 10.
    pub windows: u32,
}

impl Default for SolverSettings {
    fn default() -> Self {
        Self { step_deg: 0.75, method: Method::TrBdf2, tolerance: 1.0e-5, members: None, windows: 1 }
    }
}
