//! One signal of a message: where its bits stand and what they mean.
//!
//! Encode, decode and the DBC file all read the same [`Signal`]. Numbers that mean "no value" exist on the bus only
//! (J1939-71): they become [`Absent`] on the way in, and only this module writes them on the way out.

use super::id::Pgn;

/// Why a signal on the bus has no value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Absent {
    /// The sender has no such value: all bits set.
    NotAvailable,
    /// The sender says that the value is wrong, for instance because its sensor failed.
    Error,
    /// A raw value that the standard keeps for other use.
    Reserved,
}

/// What the raw values at the upper end mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coding {
    /// A measured quantity of 8, 16 or 32 bits: values whose highest byte is up to 0xFA are valid, 0xFE is an error, 0xFF
    /// not available, the rest reserved.
    Measured,
    /// A state: all ones is not available, one less an error.
    State,
    /// Every raw value is itself: counters, addresses, parts of a name.
    Plain,
}

/// One signal of a message.
#[derive(Debug, Clone, Copy)]
pub struct Signal {
    /// Name in the DBC file.
    pub name: &'static str,
    /// Suspect parameter number, where the standard has one.
    pub spn: Option<u32>,
    /// First bit, counted from the lowest bit of the first byte. Bytes are little endian.
    pub start: u8,
    /// Number of bits, 1 to 32.
    pub length: u8,
    /// What the raw values at the upper end mean.
    pub coding: Coding,
    /// Units per bit.
    pub scale: f32,
    /// Value of raw zero, in units.
    pub offset: f32,
    /// Symbol of the unit; empty for numbers and states.
    pub unit: &'static str,
    /// Names of raw values of a state.
    pub values: &'static [(u32, &'static str)],
    /// What it is.
    pub comment: &'static str,
}

impl Signal {
    /// Raw value with all bits set.
    #[must_use]
    pub const fn all_ones(&self) -> u32 {
        match 1_u32.checked_shl(self.length as u32) {
            Some(beyond) => beyond.wrapping_sub(1),
            None => u32::MAX,
        }
    }

    /// Largest raw value that is a value.
    #[must_use]
    pub const fn raw_max(&self) -> u32 {
        match self.coding {
            // The highest byte up to 0xFA, all below it free: five steps of the highest byte below all ones.
            Coding::Measured => {
                self.all_ones().wrapping_sub(5_u32.wrapping_shl((self.length as u32).saturating_sub(8)))
            }
            Coding::State => self.all_ones().saturating_sub(2),
            Coding::Plain => self.all_ones(),
        }
    }

    /// Smallest and largest value, in units.
    #[must_use]
    pub fn range(&self) -> (f32, f32) {
        (self.offset, self.to_units(self.raw_max()))
    }

    /// Whether a value in units is the raw value itself.
    #[must_use]
    pub fn is_raw(&self) -> bool {
        self.scale == 1.0 && self.offset == 0.0
    }

    /// Raw value as it stands in the frame.
    #[must_use]
    pub const fn bits(&self, data: &[u8; 8]) -> u32 {
        let shifted = u64::from_le_bytes(*data).wrapping_shr(self.start as u32);
        shifted as u32 & self.all_ones()
    }

    /// Raw value, or why there is none.
    ///
    /// # Errors
    /// What the sender or the standard says of raw values that are none.
    pub const fn raw(&self, data: &[u8; 8]) -> Result<u32, Absent> {
        let bits = self.bits(data);
        if bits <= self.raw_max() {
            return Ok(bits);
        }
        match self.coding {
            Coding::Plain => Ok(bits),
            Coding::State => Err(if bits == self.all_ones() { Absent::NotAvailable } else { Absent::Error }),
            Coding::Measured => match bits.wrapping_shr((self.length as u32).saturating_sub(8)) & 0xFF {
                0xFF => Err(Absent::NotAvailable),
                0xFE => Err(Absent::Error),
                _ => Err(Absent::Reserved),
            },
        }
    }

    /// Value in units, or why there is none.
    ///
    /// # Errors
    /// As [`raw`](Self::raw).
    pub fn value(&self, data: &[u8; 8]) -> Result<f32, Absent> {
        self.raw(data).map(|raw| self.to_units(raw))
    }

    fn to_units(self, raw: u32) -> f32 {
        raw as f32 * self.scale + self.offset
    }

    /// Writes a raw value; bits that do not belong to the signal are dropped.
    pub const fn put_bits(&self, data: &mut [u8; 8], bits: u32) {
        let mask = (self.all_ones() as u64).wrapping_shl(self.start as u32);
        let placed = (bits as u64).wrapping_shl(self.start as u32) & mask;
        *data = ((u64::from_le_bytes(*data) & !mask) | placed).to_le_bytes();
    }

    /// Writes why there is no value.
    pub const fn put_absent(&self, data: &mut [u8; 8], why: Absent) {
        let highest = match (self.coding, why) {
            (_, Absent::NotAvailable) => 0,
            (Coding::Measured, Absent::Error) => 1_u32.wrapping_shl((self.length as u32).saturating_sub(8)),
            (Coding::Measured, Absent::Reserved) => {
                2_u32.wrapping_shl((self.length as u32).saturating_sub(8))
            }
            (_, _) => 1,
        };
        self.put_bits(data, self.all_ones().saturating_sub(highest));
    }

    /// Writes a raw value that must be one: what is not is written as an error.
    pub const fn put_raw(&self, data: &mut [u8; 8], raw: u32) {
        if raw <= self.raw_max() {
            self.put_bits(data, raw);
        } else {
            self.put_absent(data, Absent::Error);
        }
    }

    /// Writes a value in units, rounded to the nearest step. A value that is not finite or lies outside the signal's
    /// range is written as an error, never as the nearest end of the range; half a step beyond an end is rounding.
    pub fn put(&self, data: &mut [u8; 8], value: Result<f32, Absent>) {
        match value {
            Ok(value) => {
                let steps = (value - self.offset) / self.scale;
                let beyond = self.raw_max() as f32 + 0.5;
                if steps > -0.5 && steps < beyond {
                    // The cast drops the fraction, so half a step more rounds to nearest.
                    self.put_raw(data, (steps + 0.5) as u32);
                } else {
                    self.put_absent(data, Absent::Error);
                }
            }
            Err(why) => self.put_absent(data, why),
        }
    }
}

/// Who sends a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sender {
    /// This controller.
    Kou,
    /// The drive's other controllers.
    Drive,
    /// A service tool.
    Tool,
}

impl Sender {
    /// Name in the DBC file.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Kou => "Kou",
            Self::Drive => "Drive",
            Self::Tool => "Tool",
        }
    }
}

/// One message: a parameter group and its signals.
#[derive(Debug, Clone, Copy)]
pub struct Message {
    /// Name in the DBC file.
    pub name: &'static str,
    /// Parameter group.
    pub pgn: Pgn,
    /// Priority with which it is sent, 0 first to 7 last.
    pub priority: u8,
    /// Length in bytes, 1 to 8.
    pub length: u8,
    /// Period in milliseconds; 0 for messages that are sent on request or on change.
    pub period_ms: u16,
    /// Who sends it.
    pub sender: Sender,
    /// Its signals. Bits of no signal are sent as ones.
    pub signals: &'static [Signal],
    /// What it is.
    pub comment: &'static str,
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIGNAL: Signal = Signal {
        name: "speed",
        spn: None,
        start: 8,
        length: 16,
        coding: Coding::Measured,
        scale: 0.125,
        offset: 0.0,
        unit: "r/min",
        values: &[],
        comment: "",
    };

    #[test]
    fn every_raw_value_of_a_measured_signal_is_a_value_or_its_reason() {
        for raw in 0..=0xFFFF_u32 {
            let mut data = [0xA5; 8];
            SIGNAL.put_bits(&mut data, raw);
            let wanted = match raw {
                0..=0xFAFF => Ok(raw as f32 * 0.125),
                0xFE00..=0xFEFF => Err(Absent::Error),
                0xFF00.. => Err(Absent::NotAvailable),
                _ => Err(Absent::Reserved),
            };
            assert_eq!(SIGNAL.value(&data), wanted, "{raw:04x}");
            assert_eq!([data[0], data[3]], [0xA5; 2], "neighbours are left alone");
            if let Ok(value) = wanted {
                let mut again = [0xA5; 8];
                SIGNAL.put(&mut again, Ok(value));
                assert_eq!(again, data);
            }
        }
    }

    #[test]
    fn a_value_outside_the_range_is_an_error_not_the_end_of_the_range() {
        let (min, max) = SIGNAL.range();
        assert_eq!((min, max), (0.0, 8031.875));
        for wrong in [-0.1, max + 0.1, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e30] {
            let mut data = [0; 8];
            SIGNAL.put(&mut data, Ok(wrong));
            assert_eq!(SIGNAL.value(&data), Err(Absent::Error), "{wrong}");
        }
        for (good, wanted) in [(max, max), (0.0, 0.0), (0.06, 0.0), (0.07, 0.125)] {
            let mut data = [0; 8];
            SIGNAL.put(&mut data, Ok(good));
            assert_eq!(SIGNAL.value(&data), Ok(wanted), "{good}");
        }
    }

    #[test]
    fn states_and_wide_signals_keep_their_upper_ends() {
        let state = Signal { length: 4, start: 60, coding: Coding::State, ..SIGNAL };
        let wide = Signal { length: 32, start: 32, coding: Coding::Plain, ..SIGNAL };
        let counter = Signal { coding: Coding::Measured, ..wide };
        assert_eq!((state.raw_max(), wide.raw_max(), counter.raw_max()), (13, u32::MAX, 0xFAFF_FFFF));
        let mut data = [0; 8];
        for (why, bits) in [(Absent::NotAvailable, 15), (Absent::Error, 14)] {
            state.put_absent(&mut data, why);
            assert_eq!((state.bits(&data), state.raw(&data)), (bits, Err(why)));
        }
        wide.put_raw(&mut data, 0xFFFF_FFFF);
        assert_eq!(wide.raw(&data), Ok(u32::MAX));
        counter.put_raw(&mut data, 0xFB00_0000);
        assert_eq!(counter.raw(&data), Err(Absent::Error));
    }
}
