//! NAME of a controller for the address claim (SAE J1939-81): 64 bits, the smaller value has priority.

/// Fields of a NAME, unchecked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NameConfig {
    /// Serial number of the controller, 21 bits.
    pub identity: u32,
    /// Manufacturer code assigned by SAE, 11 bits.
    pub manufacturer: u16,
    /// ECU instance, 3 bits.
    pub ecu_instance: u8,
    /// Function instance, 5 bits.
    pub function_instance: u8,
    /// Function.
    pub function: u8,
    /// Vehicle system, 7 bits.
    pub vehicle_system: u8,
    /// Vehicle system instance, 4 bits.
    pub vehicle_system_instance: u8,
    /// Industry group, 3 bits: 0 global, 1 on-highway, 2 agriculture, 3 construction.
    pub industry_group: u8,
    /// Whether the controller may use another address (128 to 247) when its own is lost.
    pub arbitrary_address: bool,
}

impl NameConfig {
    /// Second instance of a transmission controller (function 3) with this serial number and no manufacturer code:
    /// the manufacturer of the controller must set the code assigned by SAE.
    #[must_use]
    pub const fn transmission(identity: u32) -> Self {
        Self {
            identity,
            manufacturer: 0x7FF,
            ecu_instance: 1,
            function_instance: 0,
            function: 3,
            vehicle_system: 0,
            vehicle_system_instance: 0,
            industry_group: 0,
            arbitrary_address: true,
        }
    }
}

/// Error: a field of a NAME exceeds its number of bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct NameError {
    /// Name of the field.
    pub field: &'static str,
}

/// Valid NAME.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Name(u64);

impl Name {
    /// Checks the fields.
    ///
    /// # Errors
    /// The first field that has too many bits.
    pub fn new(config: &NameConfig) -> Result<Self, NameError> {
        let fields = [
            ("identity", config.identity, 21, 0),
            ("manufacturer", u32::from(config.manufacturer), 11, 21),
            ("ecu_instance", u32::from(config.ecu_instance), 3, 32),
            ("function_instance", u32::from(config.function_instance), 5, 35),
            ("function", u32::from(config.function), 8, 40),
            ("vehicle_system", u32::from(config.vehicle_system), 7, 49),
            ("vehicle_system_instance", u32::from(config.vehicle_system_instance), 4, 56),
            ("industry_group", u32::from(config.industry_group), 3, 60),
            ("arbitrary_address", u32::from(config.arbitrary_address), 1, 63),
        ];
        fields
            .into_iter()
            .try_fold(0_u64, |name, (field, value, bits, start)| {
                if u64::from(value) < 1_u64.wrapping_shl(bits) {
                    Ok(name | u64::from(value).wrapping_shl(start))
                } else {
                    Err(NameError { field })
                }
            })
            .map(Self)
    }

    /// NAME in the bytes of an address claim.
    #[must_use]
    pub const fn from_bytes(bytes: [u8; 8]) -> Self {
        Self(u64::from_le_bytes(bytes))
    }

    /// Bytes of an address claim.
    #[must_use]
    pub const fn to_bytes(self) -> [u8; 8] {
        self.0.to_le_bytes()
    }

    /// Whether the controller may use another address.
    #[must_use]
    pub const fn has_arbitrary_address(self) -> bool {
        self.0 >> 63 == 1
    }

    /// Low byte of the serial number: spreads simultaneous actions of several controllers in time.
    pub(super) const fn spread(self) -> u8 {
        self.0 as u8
    }
}
