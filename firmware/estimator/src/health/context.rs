//! Context of health monitoring: the part of the checked parameters that it borrows.

use super::params::HealthParams;
use crate::model::calibrated_model::CalibratedModel;

/// Parameters of health monitoring and the equations of the machine.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct HealthContext {
    /// Checked parameters of health monitoring.
    pub params: HealthParams,
    /// Flow balance and leakage law.
    pub model: CalibratedModel,
}
