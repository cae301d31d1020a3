//! The records that there are.

use kou_estimator::health::HealthState;
use serde::{Deserialize, Serialize};

use super::framing::{Record, RecordKind};
use crate::diagnostics::{CrashRecord, FaultMemory, ResetCause};

/// A calibration with the counter of the update that brought it: they are one record, so they cannot part.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct StoredCalibration<'a> {
    /// Counter of the update; the next one's must be higher. 0 for a calibration that came without an update.
    pub counter: u32,
    /// The calibration's binary record (`docs/calibration-record.md`), with a schema and a CRC of its own; empty when the
    /// default is to be used.
    #[serde(borrow)]
    pub record: &'a [u8],
}

impl<'a> Record<'a> for StoredCalibration<'a> {
    const KIND: RecordKind = RecordKind::Calibration;
    const SCHEMA: u16 = 1;
}

/// The counter of the last accepted update once more, by itself: it stays readable where the calibration does not, as when
/// another version wrote it. The counter in force is the larger of the two.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct UpdateCounter {
    /// Counter of the update.
    pub counter: u32,
}

impl Record<'_> for UpdateCounter {
    const KIND: RecordKind = RecordKind::UpdateCounter;
    const SCHEMA: u16 = 1;
}

/// Why the firmware stopped itself the last time that it did: the note that outlived the reset.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct CrashReport {
    /// Operating time before the stop, in seconds, as far as it had been written.
    pub operating_s: u32,
    /// What it was.
    pub crash: CrashRecord,
}

impl Record<'_> for CrashReport {
    const KIND: RecordKind = RecordKind::Stop;
    const SCHEMA: u16 = 1;
}

/// Learned health. It is relative to the law that it was learned with, so it names the calibration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HealthRecord {
    /// CRC-32 at the end of the calibration's record.
    pub calibration_crc: u32,
    /// What was learned.
    pub state: HealthState,
}

impl Record<'_> for HealthRecord {
    const KIND: RecordKind = RecordKind::Health;
    const SCHEMA: u16 = 2;
}

impl HealthRecord {
    /// The state, when it was learned with this calibration; health is learned anew when not.
    #[must_use]
    pub fn for_calibration(&self, crc: u32) -> Option<&HealthState> {
        (self.calibration_crc == crc).then_some(&self.state)
    }
}

impl Record<'_> for FaultMemory {
    const KIND: RecordKind = RecordKind::Faults;
    const SCHEMA: u16 = 1;
}

/// Hours and restarts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct OperatingCounters {
    /// Time for which the controller has been running, in seconds; up to the last write before a power cut.
    pub operating_s: u32,
    /// Starts.
    pub starts: u32,
    /// Why it started last.
    pub last_reset: ResetCause,
    /// Restarts that nobody asked for: brown-out, watchdog, panic.
    pub unplanned_resets: u32,
}

impl OperatingCounters {
    /// Nothing has happened yet.
    #[must_use]
    pub const fn new() -> Self {
        Self { operating_s: 0, starts: 0, last_reset: ResetCause::PowerOn, unplanned_resets: 0 }
    }

    /// Counts a start.
    pub fn count_start(&mut self, cause: ResetCause) {
        self.starts = self.starts.saturating_add(1);
        self.last_reset = cause;
        if cause.fault_code().is_some() {
            self.unplanned_resets = self.unplanned_resets.saturating_add(1);
        }
    }

    /// Counts operating time.
    pub fn add_operating_time(&mut self, seconds: u32) {
        self.operating_s = self.operating_s.saturating_add(seconds);
    }
}

impl Record<'_> for OperatingCounters {
    const KIND: RecordKind = RecordKind::OperatingCounters;
    const SCHEMA: u16 = 1;
}
