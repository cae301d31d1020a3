//! Calibrated equations of one machine: flow balance and leakage law.

use super::flow_balance::ReducedModel;
use super::leakage_law::Law;

/// Flow balance and leakage law of one machine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CalibratedModel {
    /// Flow balance.
    pub reduced: ReducedModel,
    /// Leakage law.
    pub law: Law,
}
