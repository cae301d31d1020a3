//! Flow balance and leakage law of one machine, side by side.

use super::flow_balance::ReducedModel;
use super::leakage_law::Law;

/// The calibrated equations of one machine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CalibratedModel {
    /// Flow balance.
    pub reduced: ReducedModel,
    /// Leakage law.
    pub law: Law,
}
