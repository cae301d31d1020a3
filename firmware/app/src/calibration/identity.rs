//! Identity of the calibration in use: its source, its checksum and the machine that it is for.

use heapless::String;

/// Where the calibration in use comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum CalibrationSource {
    /// There is none: nothing is estimated.
    #[default]
    None,
    /// The one that the firmware was built with.
    Default,
    /// The one in flash.
    Stored,
}

/// The calibration in use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CalibrationState {
    /// Where it comes from.
    pub source: CalibrationSource,
    /// CRC-32 at the end of its record; 0 without one.
    pub crc: u32,
}

impl CalibrationState {
    /// No calibration is in use.
    pub const NONE: Self = Self { source: CalibrationSource::None, crc: 0 };
}

/// Which machine a calibration is for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MachineIdentity {
    /// Type of machine.
    pub name: String<48>,
    /// Serial number; empty where the calibration is for the type.
    pub serial: String<32>,
}

impl MachineIdentity {
    /// Whether a calibration for `other` may take the place of one for this machine: of the same type, and of the same
    /// serial number where this one has one. So a controller that was delivered with its type's calibration takes
    /// one of any machine of the type, once; from then on it belongs to that machine.
    #[must_use]
    pub fn accepts(&self, other: &Self) -> bool {
        self.name == other.name && (self.serial.is_empty() || self.serial == other.serial)
    }
}
