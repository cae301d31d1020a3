//! Parameters that health monitoring borrows for one sample.

use super::params::HealthParams;
use crate::model::calibrated_model::CalibratedModel;

/// Parameters of health monitoring and the equations of the machine, borrowed for one sample.
#[derive(Debug, Clone, Copy)]
pub(crate) struct HealthContext<'a> {
    /// Checked parameters of health monitoring.
    pub params: &'a HealthParams,
    /// Flow balance and leakage law.
    pub model: &'a CalibratedModel,
}
