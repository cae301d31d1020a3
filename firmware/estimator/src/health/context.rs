//! What health monitoring borrows of the checked parameters.

use super::params::HealthParams;
use crate::model::calibrated_model::CalibratedModel;

/// Checked settings of health monitoring and the equations of the machine, borrowed for one sample.
#[derive(Debug, Clone, Copy)]
pub(crate) struct HealthContext<'a> {
    /// Checked settings.
    pub params: &'a HealthParams,
    /// Flow balance and leakage law.
    pub model: &'a CalibratedModel,
}
