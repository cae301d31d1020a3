//! Cause of the last (re)start of the controller.

use serde::{Deserialize, Serialize};

use super::dtc::FaultCode;

/// Cause of a reset as reported by the hardware; a [crash record](crate::diagnostics::crash_log) may be more precise.
/// Stored in flash by position: append only.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ResetCause {
    /// Power-on.
    #[default]
    PowerOn,
    /// Supply voltage below its limit.
    BrownOut,
    /// Watchdog.
    Watchdog,
    /// Reset requested by the firmware.
    Software,
    /// Reset pin.
    Pin,
    /// Stop by the firmware itself.
    Panic,
    /// Not reported by the hardware.
    Unknown,
}

impl ResetCause {
    /// Fault that a reset of this cause represents, if any.
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
