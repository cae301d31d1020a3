//! Bit layout and coding of one signal of a message.
//!
//! Encoder, decoder and DBC file use the same [`Signal`]. Raw values that mean "no value" exist on the bus only
//! (J1939-71): they are decoded to [`Absent`], and only this module encodes them.

use super::id::Pgn;

/// Reason why a signal has no value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Absent {
    /// Not available: all bits set.
    NotAvailable,
    /// Error reported by the sender, for instance a failed sensor.
    Error,
    /// Raw value reserved by the standard.
    Reserved,
}

/// Coding of raw values at the upper end of the range.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coding {
    /// Measured quantity of 8, 16 or 32 bits: values whose highest byte is up to 0xFA are valid, 0xFE is an error,
    /// 0xFF not available, the rest reserved.
    Measured,
    /// State: all ones is not available, one less is an error.
    State,
    /// Plain number without reserved values: counters, addresses, parts of a NAME.
    Plain,
}

/// Signal of a message.
#[derive(Debug, Clone, Copy)]
pub struct Signal {
    /// Name in the DBC file.
    pub name: &'static str,
    /// Suspect parameter number, if the standard assigns one.
    pub spn: Option<u32>,
    /// First bit, counted from the lowest bit of the first byte; little-endian.
    pub start: u8,
    /// Number of bits, 1 to 32.
    pub length: u8,
    /// Coding of the upper end of the range.
    pub coding: Coding,
    /// Units per bit.
    pub scale: f32,
    /// Physical value of raw zero.
    pub offset: f32,
    /// Unit symbol; empty for numbers and states.
    pub unit: &'static str,
    /// Names of a state's raw values.
    pub values: &'static [(u32, &'static str)],
    /// Description.
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

    /// Largest valid raw value.
    #[must_use]
    pub const fn raw_max(&self) -> u32 {
        match self.coding {
            // The highest byte goes up to 0xFA: five steps of it below all ones.
            Coding::Measured => {
                self.all_ones().wrapping_sub(5_u32.wrapping_shl((self.length as u32).saturating_sub(8)))
            }
            Coding::State => self.all_ones().saturating_sub(2),
            Coding::Plain => self.all_ones(),
        }
    }

    /// Smallest and largest physical value.
    #[must_use]
    pub fn range(&self) -> (f32, f32) {
        (self.offset, self.to_units(self.raw_max()))
    }

    /// Whether the physical value equals the raw value.
    #[must_use]
    pub fn is_raw(&self) -> bool {
        self.scale == 1.0 && self.offset == 0.0
    }

    /// Raw bits of the signal in the frame.
    #[must_use]
    pub const fn bits(&self, data: &[u8; 8]) -> u32 {
        let shifted = u64::from_le_bytes(*data).wrapping_shr(self.start as u32);
        shifted as u32 & self.all_ones()
    }

    /// Raw value, or why there is none.
    ///
    /// # Errors
    /// The reason given by a raw value without a value.
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

    /// Physical value, or why there is none.
    ///
    /// # Errors
    /// Those of [`raw`](Self::raw).
    pub fn value(&self, data: &[u8; 8]) -> Result<f32, Absent> {
        self.raw(data).map(|raw| self.to_units(raw))
    }

    fn to_units(self, raw: u32) -> f32 {
        raw as f32 * self.scale + self.offset
    }

    /// Writes raw bits; bits beyond the signal's length are dropped.
    pub const fn put_bits(&self, data: &mut [u8; 8], bits: u32) {
        let mask = (self.all_ones() as u64).wrapping_shl(self.start as u32);
        let placed = (bits as u64).wrapping_shl(self.start as u32) & mask;
        *data = ((u64::from_le_bytes(*data) & !mask) | placed).to_le_bytes();
    }

    /// Writes the raw value of a missing value.
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

    /// Writes a raw value; an invalid one is written as an error.
    pub const fn put_raw(&self, data: &mut [u8; 8], raw: u32) {
        if raw <= self.raw_max() {
            self.put_bits(data, raw);
        } else {
            self.put_absent(data, Absent::Error);
        }
    }

    /// Writes a physical value, rounded to the nearest step. A value that is not finite or out of range is written as
    /// an error, not clamped; half a step beyond the range is rounding.
    pub fn put(&self, data: &mut [u8; 8], value: Result<f32, Absent>) {
        match value {
            Ok(value) => {
                let steps = (value - self.offset) / self.scale;
                let beyond = self.raw_max() as f32 + 0.5;
                if steps > -0.5 && steps < beyond {
                    // The cast truncates, so adding half a step rounds to nearest.
                    self.put_raw(data, (steps + 0.5) as u32);
                } else {
                    self.put_absent(data, Absent::Error);
                }
            }
            Err(why) => self.put_absent(data, why),
        }
    }
}

/// Sender of a message.
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

/// Message: a parameter group and its signals.
#[derive(Debug, Clone, Copy)]
pub struct Message {
    /// Name in the DBC file.
    pub name: &'static str,
    /// Parameter group.
    pub pgn: Pgn,
    /// Priority, 0 highest to 7 lowest.
    pub priority: u8,
    /// Length in bytes, 1 to 8.
    pub length: u8,
    /// Period in milliseconds; 0 for messages sent on request or on change.
    pub period_ms: u16,
    /// Sender.
    pub sender: Sender,
    /// Signals. Unused bits are sent as ones.
    pub signals: &'static [Signal],
    /// Description.
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
    fn value_out_of_range_is_an_error_and_not_clamped() {
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
    fn states_and_wide_signals_have_correct_upper_ends() {
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
