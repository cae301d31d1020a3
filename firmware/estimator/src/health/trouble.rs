//! Diagnostic trouble: pending, confirmed, healed and aged, as on-board diagnostics count it.

use serde::{Deserialize, Serialize};

use crate::units::Micros;

/// Decisions in favour before a pending trouble is confirmed.
const CONFIRM: u8 = 10;
/// Decisions against before a confirmed trouble is healed.
const HEAL: u8 = 100;
/// Healed decisions, in units of 1000, after which the memory of it goes.
const AGE: u16 = 1000;

/// Where a trouble stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Stage {
    /// Never seen, or aged out.
    #[default]
    Absent,
    /// Seen, not yet confirmed.
    Pending,
    /// Confirmed: the lamp is on.
    Confirmed,
    /// Was confirmed and is no longer seen; remembered until it has aged.
    Healed,
}

/// One trouble with its history.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Trouble {
    /// Where it stands.
    pub stage: Stage,
    /// How often it was confirmed.
    pub occurrences: u8,
    /// When it was first confirmed.
    pub first: Micros,
    /// When it was last confirmed.
    pub last: Micros,
    counter: u8,
    age: u32,
}

impl Trouble {
    /// Never seen.
    #[must_use]
    pub const fn new() -> Self {
        Self { stage: DtcStatus::Absent, occurrences: 0, first: Micros(0), last: Micros(0), counter: 0, age: 0 }
    }

    /// Takes one decision.
    pub fn takes(&mut self, time: Micros, present: bool) {
        match (self.stage, present) {
            (DtcStatus::Absent | DtcStatus::Healed, true) => {
                self.stage = DtcStatus::Pending;
                self.counter = 1;
            }
            (DtcStatus::Pending, true) => {
                self.counter = self.counter.saturating_add(1);
                if self.counter >= CONFIRM {
                    if self.occurrences == 0 {
                        self.first = time;
                    }
                    self.stage = DtcStatus::Confirmed;
                    self.occurrences = self.occurrences.saturating_add(1);
                    self.last = time;
                    self.counter = 0;
                }
            }
            (DtcStatus::Pending, false) => {
                self.counter = self.counter.saturating_sub(1);
                if self.counter == 0 {
                    self.stage = if self.occurrences > 0 { DtcStatus::Healed } else { DtcStatus::Absent };
                }
            }
            (DtcStatus::Confirmed, true) => {
                self.counter = 0;
                self.last = time;
            }
            (DtcStatus::Confirmed, false) => {
                self.counter = self.counter.saturating_add(1);
                if self.counter >= HEAL {
                    self.stage = DtcStatus::Healed;
                    self.age = 0;
                }
            }
            (DtcStatus::Healed, false) => {
                self.age = self.age.saturating_add(1);
                if self.age >= 1000 * u32::from(AGE) {
                    *self = Self::default();
                }
            }
            (DtcStatus::Absent, false) => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn trouble_is_debounced_confirmed_healed_and_aged() {
        let mut trouble = Trouble::default();
        for i in 0..5 {
            trouble.takes(Micros(i), true);
        }
        assert_eq!(trouble.stage, DtcStatus::Pending);
        (0..5).for_each(|_| trouble.takes(Micros(9), false));
        assert_eq!(trouble.stage, DtcStatus::Absent);
        (0..10).for_each(|i| trouble.takes(Micros(20 + i), true));
        assert_eq!((trouble.stage, trouble.occurrences, trouble.first), (DtcStatus::Confirmed, 1, Micros(29)));
        (0..100).for_each(|_| trouble.takes(Micros(50), false));
        assert_eq!(trouble.stage, DtcStatus::Healed);
        (0..10).for_each(|_| trouble.takes(Micros(60), true));
        assert_eq!((trouble.stage, trouble.occurrences, trouble.last), (DtcStatus::Confirmed, 2, Micros(60)));
        (0..100).for_each(|_| trouble.takes(Micros(70), false));
        (0..1_000_000).for_each(|_| trouble.takes(Micros(80), false));
        assert_eq!(trouble, Trouble::default());
    }
}
