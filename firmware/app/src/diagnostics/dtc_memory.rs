//! Fault memory: active and previous trouble codes, their occurrence counts and freeze frames.
//!
//! It holds [`CAPACITY`] entries. When it is full, a new entry replaces the least important one: first rejected
//! updates, so that no node on the bus can displace faults of the machine, then inactive entries, the oldest first.
//! Active entries are never displaced; faults without room are counted.

use heapless::Vec;
use kou_estimator::Sample;
use kou_estimator::health::DtcStatus;
use kou_estimator::units::{Celsius, Megapascal, Ratio, RevPerMin};
use serde::{Deserialize, Serialize};

use super::dtc::{Dtc, FaultCode, Lamp};

/// Capacity of the memory.
pub const CAPACITY: usize = 12;
/// Largest occurrence count that DM1 can report.
const OCCURRENCES_MAX: u8 = 126;

/// Freeze frame: measured values at the time of a fault, stored in whole steps so that a full memory fits a flash
/// page.
#[doc(alias = "snapshot")]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct FreezeFrame {
    /// Operating time of the controller, in seconds.
    pub operating_s: u32,
    pump_speed_rpm: Option<i16>,
    motor_speed_rpm: Option<i16>,
    high_pressure_10kpa: Option<i16>,
    oil_temperature_100mk: Option<i16>,
    displacement_1e4: Option<i16>,
}

/// Value in whole steps; `None` for a missing value and for one out of range.
fn steps(value: f32, per_step: f32) -> Option<i16> {
    let scaled = value / per_step;
    let rounded = if scaled < 0.0 { scaled - 0.5 } else { scaled + 0.5 };
    // The bounds make the cast exact; NaN fails both comparisons.
    (rounded > -32_768.0 && rounded < 32_767.0).then_some(rounded as i16)
}

impl FreezeFrame {
    /// Freeze frame of a sample at this operating time.
    #[must_use]
    pub fn of(operating_s: u32, sample: &Sample) -> Self {
        Self {
            operating_s,
            pump_speed_rpm: sample.pump_speed.value.ok().and_then(|n| steps(n.get(), 1.0)),
            motor_speed_rpm: sample.motor_speed.value.ok().and_then(|n| steps(n.get(), 1.0)),
            high_pressure_10kpa: sample.high_pressure.value.ok().and_then(|p| steps(p.get(), 0.01)),
            oil_temperature_100mk: sample.oil_temperature.value.ok().and_then(|t| steps(t.get(), 0.1)),
            displacement_1e4: sample.displacement.value.ok().and_then(|a| steps(a.get(), 1e-4)),
        }
    }

    /// Operating time only, without a sample.
    #[must_use]
    pub const fn at(operating_s: u32) -> Self {
        Self {
            operating_s,
            pump_speed_rpm: None,
            motor_speed_rpm: None,
            high_pressure_10kpa: None,
            oil_temperature_100mk: None,
            displacement_1e4: None,
        }
    }

    /// Pump speed, to 1 r/min.
    #[must_use]
    pub fn pump_speed(&self) -> Option<RevPerMin> {
        self.pump_speed_rpm.map(|n| RevPerMin(f32::from(n)))
    }

    /// Motor speed, to 1 r/min.
    #[must_use]
    pub fn motor_speed(&self) -> Option<RevPerMin> {
        self.motor_speed_rpm.map(|n| RevPerMin(f32::from(n)))
    }

    /// High pressure, to 0.01 MPa, gauge.
    #[must_use]
    pub fn high_pressure(&self) -> Option<Megapascal> {
        self.high_pressure_10kpa.map(|p| Megapascal(f32::from(p) * 0.01))
    }

    /// Oil temperature, to 0.1 K.
    #[must_use]
    pub fn oil_temperature(&self) -> Option<Celsius> {
        self.oil_temperature_100mk.map(|t| Celsius(f32::from(t) * 0.1))
    }

    /// Displacement fraction, to 0.0001.
    #[must_use]
    pub fn displacement(&self) -> Option<Ratio> {
        self.displacement_1e4.map(|a| Ratio(f32::from(a) * 1e-4))
    }
}

/// Entry of the fault memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DtcEntry {
    /// Trouble code.
    pub dtc: Dtc,
    /// Whether the fault is active (DM1) or previous (DM2).
    pub active: bool,
    /// Occurrence count, 1 to 126.
    pub occurrences: u8,
    /// Freeze frame of the first occurrence.
    pub first: FreezeFrame,
    /// Freeze frame of the last occurrence.
    pub last: FreezeFrame,
}

/// Trouble code as reported on the bus, without freeze frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DtcReport {
    /// Trouble code.
    pub dtc: Dtc,
    /// Whether the fault is active (DM1) or previous (DM2).
    pub active: bool,
    /// Occurrence count, 1 to 126.
    pub occurrences: u8,
}

/// Trouble codes as reported on the bus: a small copy of the memory, because building messages from it takes longer
/// than other tasks may be locked out.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct DtcList(Vec<DtcReport, CAPACITY>);

impl DtcList {
    /// Trouble codes in the memory's order.
    #[must_use]
    pub fn all(&self) -> &[DtcReport] {
        &self.0
    }

    /// Whether any fault is active.
    #[must_use]
    pub fn has_active(&self) -> bool {
        self.0.iter().any(|report| report.active)
    }

    /// Lamp lit by the active faults.
    #[must_use]
    pub fn lamp(&self) -> Lamp {
        let lit = |report: &DtcReport| {
            report.active && FaultCode::from_dtc(report.dtc).map(FaultCode::lamp) == Some(Lamp::Amber)
        };
        if self.0.iter().any(lit) { Lamp::Amber } else { Lamp::None }
    }
}

impl DtcEntry {
    /// Fault of the entry, if this version knows its code.
    #[must_use]
    pub fn code(&self) -> Option<FaultCode> {
        FaultCode::from_dtc(self.dtc)
    }

    /// Retention rank: the larger, the more important.
    fn rank(&self) -> (u8, u32) {
        let importance = match self.code() {
            _ if self.active => 2,
            Some(FaultCode::UpdateRefused(_)) => 0,
            _ => 1,
        };
        (importance, self.last.operating_s)
    }
}

/// Fault memory.
#[doc(alias = "DTC memory")]
#[doc(alias = "error memory")]
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct FaultMemory {
    entries: Vec<DtcEntry, CAPACITY>,
    /// Faults for which there was no room; saturates.
    lost: u16,
    #[serde(skip)]
    changed: bool,
}

impl FaultMemory {
    /// Empty memory.
    #[must_use]
    pub const fn new() -> Self {
        Self { entries: Vec::new(), lost: 0, changed: false }
    }

    /// Every entry, in no particular order.
    #[must_use]
    pub fn entries(&self) -> &[DtcEntry] {
        &self.entries
    }

    /// Entries of active faults.
    pub fn active(&self) -> impl Iterator<Item = &DtcEntry> {
        self.entries.iter().filter(|entry| entry.active)
    }

    /// Entries of previous faults.
    pub fn previous(&self) -> impl Iterator<Item = &DtcEntry> {
        self.entries.iter().filter(|entry| !entry.active)
    }

    /// Entry of a fault.
    #[must_use]
    pub fn get(&self, code: FaultCode) -> Option<&DtcEntry> {
        let dtc = code.dtc();
        self.entries.iter().find(|entry| entry.dtc == dtc)
    }

    /// Number of faults for which there was no room.
    #[must_use]
    pub fn lost(&self) -> u16 {
        self.lost
    }

    /// Trouble codes as reported on the bus.
    #[must_use]
    pub fn reports(&self) -> DtcList {
        let short = |entry: &DtcEntry| DtcReport {
            dtc: entry.dtc,
            active: entry.active,
            occurrences: entry.occurrences,
        };
        DtcList(self.entries.iter().map(short).collect())
    }

    /// Whether anything has changed since the last call; called by the storage task before a write. The task limits
    /// its rate, since faults caused by other nodes must not wear out the flash.
    pub fn take_changed(&mut self) -> bool {
        core::mem::take(&mut self.changed)
    }

    /// Sets the status of a debounced fault. May be called at any rate; an unchanged status has no effect.
    pub fn set_status(&mut self, code: FaultCode, stage: DtcStatus, snapshot: FreezeFrame) {
        match stage {
            DtcStatus::Confirmed => self.confirm(code, snapshot),
            DtcStatus::Healed | DtcStatus::Absent => self.heal(code),
            DtcStatus::Pending => {}
        }
    }

    /// Confirms a fault. Counted once until it heals.
    pub fn confirm(&mut self, code: FaultCode, snapshot: FreezeFrame) {
        self.record(code, snapshot, true);
    }

    /// Heals a fault.
    pub fn heal(&mut self, code: FaultCode) {
        let dtc = code.dtc();
        if let Some(entry) = self.entries.iter_mut().find(|entry| entry.dtc == dtc && entry.active) {
            entry.active = false;
            self.changed = true;
        }
    }

    /// Records an event without duration: a rejected update, a restart.
    pub fn record_event(&mut self, code: FaultCode, snapshot: FreezeFrame) {
        self.record(code, snapshot, false);
    }

    /// Merges the memory that an earlier run left in flash with the present one. No fault of the earlier run remains
    /// active: one that persists occurs anew. `stored` is left with the previous content of this memory.
    pub fn restore(&mut self, stored: &mut Self) {
        core::mem::swap(self, stored);
        let since_start = stored;
        for entry in &mut self.entries {
            entry.active = false;
        }
        self.lost = self.lost.saturating_add(since_start.lost);
        self.changed |= since_start.changed;
        for entry in &since_start.entries {
            self.merge(entry);
        }
    }

    /// Erases every inactive entry, as the service function "clear" does.
    pub fn clear_previous(&mut self) {
        let before = self.entries.len();
        self.entries.retain(|entry| entry.active);
        self.changed |= before != self.entries.len() || self.lost > 0;
        self.lost = 0;
    }

    fn record(&mut self, code: FaultCode, snapshot: FreezeFrame, active: bool) {
        let dtc = code.dtc();
        self.merge(&DtcEntry { dtc, active, occurrences: 1, first: snapshot, last: snapshot });
    }

    /// Adds occurrences to the entry of the same code, or makes room for a new entry.
    fn merge(&mut self, new: &DtcEntry) {
        if let Some(entry) = self.entries.iter_mut().find(|entry| entry.dtc == new.dtc) {
            if entry.active && new.active {
                return;
            }
            entry.active = new.active;
            entry.occurrences = entry.occurrences.saturating_add(new.occurrences).min(OCCURRENCES_MAX);
            entry.last = new.last;
            self.changed = true;
            return;
        }
        self.changed = true;
        let Err(entry) = self.entries.push(*new) else { return };
        let least = self.entries.iter_mut().min_by_key(|entry| entry.rank());
        match least {
            // An entry of equal importance does not displace the oldest one.
            Some(least) if least.rank().0 < 2 && least.rank().0 <= entry.rank().0 => *least = entry,
            _ => self.lost = self.lost.saturating_add(1),
        }
    }
}

#[cfg(test)]
mod tests {
    use kou_estimator::units::Micros;
    use kou_estimator::{Channel, Fault, Reading};

    use super::*;
    use crate::diagnostics::RejectReason;

    fn sensor(fault: Fault) -> FaultCode {
        FaultCode::Sensor(Channel::HighPressure, fault)
    }

    #[test]
    fn first_and_last_freeze_frame_and_occurrences_are_stored() {
        let mut memory = FaultMemory::new();
        let code = sensor(Fault::Open);
        let mut sample = Sample::empty(Micros(0));
        sample.pump_speed = Reading::new(Micros(0), RevPerMin(1499.6));
        sample.displacement = Reading::new(Micros(0), Ratio(-0.5));
        memory.confirm(code, FreezeFrame::of(100, &sample));
        memory.confirm(code, FreezeFrame::at(101));
        assert_eq!(memory.get(code).unwrap().occurrences, 1, "still the same one");
        memory.set_status(code, DtcStatus::Pending, FreezeFrame::at(150));
        assert_eq!(memory.active().count(), 1);
        memory.set_status(code, DtcStatus::Healed, FreezeFrame::at(200));
        assert_eq!((memory.active().count(), memory.previous().count()), (0, 1));
        memory.confirm(code, FreezeFrame::at(300));
        let entry = memory.get(code).unwrap();
        assert_eq!((entry.occurrences, entry.first.operating_s, entry.last.operating_s), (2, 100, 300));
        assert_eq!(entry.first.pump_speed(), Some(RevPerMin(1500.0)));
        assert_eq!(entry.first.displacement(), Some(Ratio(-0.5)));
        assert_eq!(entry.first.high_pressure(), None);
        assert_eq!(memory.reports().lamp(), Lamp::Amber);
        assert!(memory.take_changed() && !memory.take_changed());
    }

    #[test]
    fn rejected_updates_cannot_displace_faults_of_the_machine() {
        let mut memory = FaultMemory::new();
        memory.confirm(sensor(Fault::Open), FreezeFrame::at(1));
        memory.record_event(FaultCode::Watchdog, FreezeFrame::at(2));
        for round in 0..10 {
            for reason in RejectReason::ALL {
                memory.record_event(FaultCode::UpdateRefused(reason), FreezeFrame::at(10 + round));
            }
        }
        assert!(memory.get(sensor(Fault::Open)).is_some() && memory.get(FaultCode::Watchdog).is_some());
        assert_eq!(memory.entries().len(), CAPACITY);
        // A fault of the machine still finds room in the full memory.
        memory.confirm(FaultCode::Wear, FreezeFrame::at(50));
        assert!(memory.get(FaultCode::Wear).is_some());
    }

    #[test]
    fn active_faults_are_never_displaced_and_others_are_counted() {
        let mut memory = FaultMemory::new();
        let codes: std::vec::Vec<FaultCode> = FaultCode::all().take(CAPACITY + 3).collect();
        for (i, code) in codes.iter().enumerate() {
            memory.confirm(*code, FreezeFrame::at(i as u32));
        }
        assert!(codes[..CAPACITY].iter().all(|code| memory.get(*code).is_some()));
        assert_eq!(memory.lost(), 3);
        memory.heal(codes[4]);
        memory.confirm(codes[CAPACITY], FreezeFrame::at(99));
        assert!(memory.get(codes[4]).is_none() && memory.get(codes[CAPACITY]).is_some());
        memory.clear_previous();
        assert_eq!((memory.entries().len(), memory.lost()), (CAPACITY, 0));
    }

    #[test]
    fn occurrences_saturate_at_the_maximum_of_the_bus() {
        let mut memory = FaultMemory::new();
        for i in 0..1000 {
            memory.record_event(FaultCode::Watchdog, FreezeFrame::at(i));
        }
        assert_eq!(memory.get(FaultCode::Watchdog).unwrap().occurrences, 126);
    }
}
