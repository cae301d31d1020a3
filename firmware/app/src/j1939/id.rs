//! Identifiers and frames of SAE J1939: the 29-bit extended CAN identifier as priority, parameter group number,
//! destination and source (J1939-21).
//!
//! ```text
//! bit 28..26   25   24   23..16   15..8                        7..0
//!     priority EDP  DP   PF       PS: destination if PF < 240  source
//!                                     group extension if not
//! ```

use embedded_can::{ExtendedId, Frame as CanFrame, Id as CanId};

/// Global destination address.
pub const GLOBAL: u8 = 0xFF;
/// Null address: source address of a controller without one.
pub const NULL_ADDRESS: u8 = 0xFE;

/// Parameter group number, 18 bits.
///
/// For a group with a destination (PDU1, PF below 240) the low byte is 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Pgn(u32);

impl Pgn {
    /// Group of a number; bits beyond the 18th and the destination byte of a PDU1 group are dropped.
    #[must_use]
    pub const fn new(number: u32) -> Self {
        let number = number & 0x3_FFFF;
        if Self(number).is_addressed() { Self(number & 0x3_FF00) } else { Self(number) }
    }

    /// Number of the group.
    #[must_use]
    pub const fn get(self) -> u32 {
        self.0
    }

    /// Whether frames of the group have a destination (PDU1) rather than being broadcast (PDU2).
    #[must_use]
    pub const fn is_addressed(self) -> bool {
        (self.0 >> 8) & 0xFF < 240
    }

    /// Number in three bytes, low byte first, as in requests and announcements.
    #[must_use]
    pub const fn to_le_bytes(self) -> [u8; 3] {
        let [low, middle, high, _] = self.0.to_le_bytes();
        [low, middle, high]
    }

    /// Group of three bytes, low byte first.
    #[must_use]
    pub const fn from_le_bytes([low, middle, high]: [u8; 3]) -> Self {
        Self::new(u32::from_le_bytes([low, middle, high, 0]))
    }
}

/// 29-bit identifier.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Id(u32);

impl Id {
    /// Identifier of a group. `priority` is 0 (highest) to 7; `destination` is ignored for a group without one.
    #[must_use]
    pub const fn new(priority: u8, pgn: Pgn, destination: u8, source: u8) -> Self {
        let group = if pgn.is_addressed() { pgn.0 | destination as u32 } else { pgn.0 };
        Self(((priority & 7) as u32) << 26 | group << 8 | source as u32)
    }

    /// Identifier of 29 bits; higher bits are dropped.
    #[must_use]
    pub const fn from_raw(raw: u32) -> Self {
        Self(raw & 0x1FFF_FFFF)
    }

    /// Raw 29 bits.
    #[must_use]
    pub const fn raw(self) -> u32 {
        self.0
    }

    /// Priority, 0 highest to 7 lowest.
    #[must_use]
    pub const fn priority(self) -> u8 {
        (self.0 >> 26) as u8
    }

    /// Parameter group.
    #[must_use]
    pub const fn pgn(self) -> Pgn {
        Pgn::new(self.0 >> 8)
    }

    /// Source address.
    #[must_use]
    pub const fn source(self) -> u8 {
        self.0 as u8
    }

    /// Destination address: [`GLOBAL`] for a group without one.
    #[must_use]
    pub const fn destination(self) -> u8 {
        if self.pgn().is_addressed() { (self.0 >> 8) as u8 } else { GLOBAL }
    }
}

/// Data frame with a 29-bit identifier and at most eight bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Frame {
    id: Id,
    data: [u8; 8],
    len: u8,
}

impl Frame {
    /// Frame of eight bytes.
    #[must_use]
    pub const fn new(id: Id, data: [u8; 8]) -> Self {
        Self { id, data, len: 8 }
    }

    /// Frame of at most eight bytes.
    #[must_use]
    pub fn of(id: Id, bytes: &[u8]) -> Option<Self> {
        let mut data = [0xFF; 8];
        data.get_mut(..bytes.len())?.copy_from_slice(bytes);
        Some(Self { id, data, len: u8::try_from(bytes.len()).ok()? })
    }

    /// Identifier.
    #[must_use]
    pub const fn id(&self) -> Id {
        self.id
    }

    /// Data bytes.
    #[must_use]
    pub fn data(&self) -> &[u8] {
        self.data.get(..usize::from(self.len)).unwrap_or(&self.data)
    }

    /// Data of a full frame; `None` for a shorter one, which does not hold a complete parameter group.
    #[must_use]
    pub const fn full(&self) -> Option<&[u8; 8]> {
        if self.len == 8 { Some(&self.data) } else { None }
    }

    /// Converts a received frame of a CAN driver; `None` for remote frames and 11-bit identifiers, which J1939 does
    /// not use.
    #[must_use]
    pub fn from_can(frame: &impl CanFrame) -> Option<Self> {
        match frame.id() {
            CanId::Extended(id) if frame.is_data_frame() => Self::of(Id::from_raw(id.as_raw()), frame.data()),
            _ => None,
        }
    }

    /// Converts to a frame of a CAN driver; `None` when the driver rejects it.
    #[must_use]
    pub fn to_can<F: CanFrame>(&self) -> Option<F> {
        F::new(ExtendedId::new(self.id.raw())?, self.data())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn identifiers_agree_with_published_ones() {
        // ETC1 of a transmission (address 3): 0x0CF00203; a global request from the tool F9: 0x18EAFFF9.
        let etc1 = Id::from_raw(0x0CF0_0203);
        assert_eq!(
            (etc1.priority(), etc1.pgn(), etc1.source(), etc1.destination()),
            (3, Pgn::new(61442), 3, GLOBAL)
        );
        assert_eq!(Id::new(6, Pgn::new(59904), GLOBAL, 0xF9).raw(), 0x18EA_FFF9);
        let request = Id::from_raw(0x18EA_27F9);
        assert_eq!((request.pgn(), request.destination()), (Pgn::new(59904), 0x27));
    }

    #[test]
    fn prop_every_identifier_survives_a_round_trip() {
        for step in 0..1_000_000_u32 {
            let id = Id::from_raw(step.wrapping_mul(0x9E37_79B9) >> 3);
            let again = Id::new(id.priority(), id.pgn(), id.destination(), id.source());
            assert_eq!(id, again);
        }
    }
}
