//! Settings of the steady-state solver.

use crate::tableau::Method;

/// Windows of the members after which the search gives up.
pub(super) const MAX_WINDOWS: u32 = 10;

/// How finely to compute.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SolverSettings {
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

impl Default for SolverSettings {
    fn default() -> Self {
        Self { step_deg: 0.75, method: Method::TrBdf2, tolerance: 1.0e-5, members: None, windows: 1 }
    }
}
