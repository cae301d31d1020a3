//! Context of health monitoring: the part of the checked parameters that it borrows.

use super::params::HealthParams;
use crate::model::flow_balance::ReducedModel;
use crate::model::leakage_law::Law;

/// Parameters of health monitoring and the equations of the machine.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct HealthContext {
    /// Checked parameters of health monitoring.
    pub params: HealthParams,
    /// Flow balance.
    pub reduced: ReducedModel,
    /// Leakage law.
    pub law: Law,
}
