//! Identifiers and frames of SAE J1939: the 29-bit extended identifier of CAN split into priority, parameter group
//! number, destination and source (J1939-21).
//!
//! ```text
//! bit 28..26   25   24   23..16   15..8                        7..0
//!     priority EDP  DP   PF       PS: destination if PF < 240  source
//!                                     group extension if not
//! ```

use embedded_can::{ExtendedId, Frame as CanFrame, Id as CanId};

/// Address that stands for everyone.
pub const GLOBAL: u8 = 0xFF;
/// Source address of a controller that has none.
pub const NULL_ADDRESS: u8 = 0xFE;

/// Parameter group number, 18 bits.
///
/// Of a group that goes to one destination (PDU1, PF below 240) the low byte is 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Pgn(u32);

impl Pgn {
    /// The group of this number; bits beyond the 18th, and the destination's place of a PDU1 group, are dropped.
    #[must_use]
    pub const fn new(number: u32) -> Self {
        let number = number & 0x3_FFFF;
        if Self(number).is_addressed() { Self(number & 0x3_FF00) } else { Self(number) }
    }

    /// The number.
    #[must_use]
    pub const fn get(self) -> u32 {
        self.0
    }

    /// Whether frames of the group name a destination (PDU1) rather than go to everyone (PDU2).
    #[must_use]
    pub const fn is_addressed(self) -> bool {
        (self.0 >> 8) & 0xFF < 240
    }

    /// The number in the three bytes, low first, that requests and announcements carry.
    #[must_use]
    pub const fn to_le_bytes(self) -> [u8; 3] {
        let [low, middle, high, _] = self.0.to_le_bytes();
        [low, middle, high]
    }

    /// The group named by three bytes, low first.
    #[must_use]
    pub const fn from_le_bytes([low, middle, high]: [u8; 3]) -> Self {
        Self::new(u32::from_le_bytes([low, middle, high, 0]))
    }
}

/// A 29-bit identifier.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Id(u32);

impl Id {
    /// Identifier of a group. `priority` is 0 (first) to 7; of a group without destination, `destination` is ignored.
    #[must_use]
    pub const fn new(priority: u8, pgn: Pgn, destination: u8, source: u8) -> Self {
        let group = if pgn.is_addressed() { pgn.0 | destination as u32 } else { pgn.0 };
        Self(((priority & 7) as u32) << 26 | group << 8 | source as u32)
    }

    /// Identifier of these 29 bits; higher ones are dropped.
    #[must_use]
    pub const fn from_raw(raw: u32) -> Self {
        Self(raw & 0x1FFF_FFFF)
    }

    /// The 29 bits.
    #[must_use]
    pub const fn raw(self) -> u32 {
        self.0
    }

    /// Priority, 0 first to 7 last.
    #[must_use]
    pub const fn priority(self) -> u8 {
        (self.0 >> 26) as u8
    }

    /// The parameter group.
    #[must_use]
    pub const fn pgn(self) -> Pgn {
        Pgn::new(self.0 >> 8)
    }

    /// Who sent it.
    #[must_use]
    pub const fn source(self) -> u8 {
        self.0 as u8
    }

    /// Who it is for: [`GLOBAL`] of a group without destination.
    #[must_use]
    pub const fn destination(self) -> u8 {
        if self.pgn().is_addressed() { (self.0 >> 8) as u8 } else { GLOBAL }
    }
}

/// A data frame with a 29-bit identifier and at most eight bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Frame {
    id: Id,
    data: [u8; 8],
    len: u8,
}

impl Frame {
    /// A frame of eight bytes.
    #[must_use]
    pub const fn new(id: Id, data: [u8; 8]) -> Self {
        Self { id, data, len: 8 }
    }

    /// A frame of at most eight bytes.
    #[must_use]
    pub fn of(id: Id, bytes: &[u8]) -> Option<Self> {
        let mut data = [0xFF; 8];
        data.get_mut(..bytes.len())?.copy_from_slice(bytes);
        Some(Self { id, data, len: u8::try_from(bytes.len()).ok()? })
    }

    /// The identifier.
    #[must_use]
    pub const fn id(&self) -> Id {
        self.id
    }

    /// The bytes.
    #[must_use]
    pub fn data(&self) -> &[u8] {
        self.data.get(..usize::from(self.len)).unwrap_or(&self.data)
    }

    /// The bytes of a full frame; nothing of a shorter one, which holds no whole parameter group.
    #[must_use]
    pub const fn full(&self) -> Option<&[u8; 8]> {
        if self.len == 8 { Some(&self.data) } else { None }
    }

    /// The frame as a driver received it; nothing when it is a remote frame or has an 11-bit identifier: J1939 has
    /// neither.
    #[must_use]
    pub fn from_can(frame: &impl CanFrame) -> Option<Self> {
        match frame.id() {
            CanId::Extended(id) if frame.is_data_frame() => Self::of(Id::from_raw(id.as_raw()), frame.data()),
            _ => None,
        }
    }

    /// The frame as a driver sends it; nothing when the driver refuses it.
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
    fn prop_every_identifier_is_put_together_again() {
        for step in 0..1_000_000_u32 {
            let id = Id::from_raw(step.wrapping_mul(0x9E37_79B9) >> 3);
            let again = Id::new(id.priority(), id.pgn(), id.destination(), id.source());
            assert_eq!(id, again);
        }
    }
}
