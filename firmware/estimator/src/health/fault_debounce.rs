//! Debouncing of diagnostic faults: pending, confirmed, healed and aged, as on-board diagnostics count them
//! (SAE J1939-73, ISO 14229-1).

use serde::{Deserialize, Serialize};

use super::tuning::{AGE_COUNT, CONFIRM_COUNT, HEAL_COUNT};
use crate::units::Micros;

/// Status of a diagnostic fault.
#[doc(alias = "diagnostic trouble code")]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum DtcStatus {
    /// Never detected, or aged out.
    #[default]
    Absent,
    /// Detected, not yet confirmed.
    Pending,
    /// Confirmed: the lamp is on.
    Confirmed,
    /// Confirmed earlier and no longer detected; stored until it has aged.
    Healed,
}

/// One diagnostic fault with its history.
#[doc(alias = "DTC")]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DiagnosticFault {
    /// Present status.
    pub status: DtcStatus,
    /// Number of times it was confirmed.
    pub occurrences: u8,
    /// Time at which it was first confirmed.
    pub first: Micros,
    /// Time at which it was last confirmed.
    pub last: Micros,
    counter: u8,
    age: u32,
}

impl DiagnosticFault {
    /// Fault that was never detected.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            status: DtcStatus::Absent,
            occurrences: 0,
            first: Micros(0),
            last: Micros(0),
            counter: 0,
            age: 0,
        }
    }

    /// Counts one decision for or against the fault.
    pub fn update(&mut self, time: Micros, present: bool) {
        match (self.status, present) {
            (DtcStatus::Absent | DtcStatus::Healed, true) => {
                self.status = DtcStatus::Pending;
                self.counter = 1;
            }
            (DtcStatus::Pending, true) => {
                self.counter = self.counter.saturating_add(1);
                if self.counter >= CONFIRM_COUNT {
                    if self.occurrences == 0 {
                        self.first = time;
                    }
                    self.status = DtcStatus::Confirmed;
                    self.occurrences = self.occurrences.saturating_add(1);
                    self.last = time;
                    self.counter = 0;
                }
            }
            (DtcStatus::Pending, false) => {
                self.counter = self.counter.saturating_sub(1);
                if self.counter == 0 {
                    self.status = if self.occurrences > 0 { DtcStatus::Healed } else { DtcStatus::Absent };
                }
            }
            (DtcStatus::Confirmed, true) => {
                self.counter = 0;
                self.last = time;
            }
            (DtcStatus::Confirmed, false) => {
                self.counter = self.counter.saturating_add(1);
                if self.counter >= HEAL_COUNT {
                    self.status = DtcStatus::Healed;
                    self.age = 0;
                }
            }
            (DtcStatus::Healed, false) => {
                self.age = self.age.saturating_add(1);
                if self.age >= AGE_COUNT {
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
    fn fault_is_debounced_confirmed_healed_and_aged() {
        let mut fault = DiagnosticFault::default();
        for i in 0..5 {
            fault.update(Micros(i), true);
        }
        assert_eq!(fault.status, DtcStatus::Pending);
        (0..5).for_each(|_| fault.update(Micros(9), false));
        assert_eq!(fault.status, DtcStatus::Absent);
        (0..10).for_each(|i| fault.update(Micros(20 + i), true));
        assert_eq!((fault.status, fault.occurrences, fault.first), (DtcStatus::Confirmed, 1, Micros(29)));
        (0..100).for_each(|_| fault.update(Micros(50), false));
        assert_eq!(fault.status, DtcStatus::Healed);
        (0..10).for_each(|_| fault.update(Micros(60), true));
        assert_eq!((fault.status, fault.occurrences, fault.last), (DtcStatus::Confirmed, 2, Micros(60)));
        (0..100).for_each(|_| fault.update(Micros(70), false));
        (0..1_000_000).for_each(|_| fault.update(Micros(80), false));
        assert_eq!(fault, DiagnosticFault::default());
    }
}
