//! Identity of the calibration in use: its source, its checksum and the machine that it is for.

use heapless::String;

/// Source of the calibration in use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum CalibrationSource {
    /// No calibration; nothing is estimated.
    #[default]
    None,
    /// Default that the firmware was built or provisioned with.
    Default,
    /// Record stored in flash.
    Stored,
}

/// Source and checksum of the calibration in use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CalibrationState {
    /// Source.
    pub source: CalibrationSource,
    /// CRC-32 at the end of its record; 0 without a calibration.
    pub crc: u32,
}

impl CalibrationState {
    /// No calibration in use.
    pub const NONE: Self = Self { source: CalibrationSource::None, crc: 0 };
}

/// Machine that a calibration is valid for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MachineIdentity {
    /// Machine type.
    pub name: String<48>,
    /// Serial number; empty for a calibration of the type.
    pub serial: String<32>,
}

impl MachineIdentity {
    /// Whether a calibration for `other` may replace one for this machine: same type, and same serial number where
    /// this one has one. A controller delivered with its type's calibration therefore accepts that of any machine of
    /// the type once, and is bound to that machine afterwards.
    #[must_use]
    pub fn accepts(&self, other: &Self) -> bool {
        self.name == other.name && (self.serial.is_empty() || self.serial == other.serial)
    }
}
