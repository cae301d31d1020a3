//! Cause of the last (re)start of the controller.

use serde::{Deserialize, Serialize};

use super::dtc::FaultCode;

/// Why the controller (re)started, as its hardware tells; a [note](crate::diagnostics::crash_log) may know better. On flash by
/// position: append only.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ResetCause {
    /// The supply came.
    #[default]
    PowerOn,
    /// The supply fell below its limit.
    BrownOut,
    /// The watchdog.
    Watchdog,
    /// The firmware, on request.
    Software,
    /// The reset pin.
    Pin,
    /// The firmware stopped itself.
    Panic,
    /// The hardware does not say.
    Unknown,
}

impl ResetCause {
    /// The trouble that a start from this cause is, if any.
    #[must_use]
    pub const fn fault_code(self) -> Option<FaultCode> {
        match self {
            Self::BrownOut => Some(FaultCode::BrownOut),
            Self::Watchdog => Some(FaultCode::Watchdog),
            Self::Panic => Some(FaultCode::Panic),
            Self::PowerOn | Self::Software | Self::Pin | Self::Unknown => None,
        }
    }
}
