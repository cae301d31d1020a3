//! Record types stored in flash.

use kou_estimator::health::HealthState;
use serde::{Deserialize, Serialize};

use super::framing::{Record, RecordKind};
use crate::diagnostics::{CrashRecord, FaultMemory, ResetCause};

/// Calibration together with the counter of its update, in one record so that they are always consistent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct StoredCalibration<'a> {
    /// Counter of the update; the next update needs a higher one. 0 for a calibration that did not come by an update.
    pub counter: u32,
    /// Binary calibration record (`docs/calibration-record.md`) with its own schema and CRC; empty to select the
    /// default.
    #[serde(borrow)]
    pub record: &'a [u8],
}

impl<'a> Record<'a> for StoredCalibration<'a> {
    const KIND: RecordKind = RecordKind::Calibration;
    const SCHEMA: u16 = 1;
}

/// Counter of the last accepted update as a separate record: readable even if the calibration is not, for instance
/// because another version wrote it. The larger of the two counters is in force.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct UpdateCounter {
    /// Counter of the update.
    pub counter: u32,
}

impl Record<'_> for UpdateCounter {
    const KIND: RecordKind = RecordKind::UpdateCounter;
    const SCHEMA: u16 = 1;
}

/// Crash report: the last crash record that survived a reset, with its operating time.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct CrashReport {
    /// Operating time before the crash, in seconds, as last written.
    pub operating_s: u32,
    /// Crash record.
    pub crash: CrashRecord,
}

impl Record<'_> for CrashReport {
    const KIND: RecordKind = RecordKind::Stop;
    const SCHEMA: u16 = 1;
}

/// Learned health with the calibration that it refers to, since health is relative to that calibration's law.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct HealthRecord {
    /// CRC-32 at the end of the calibration's record.
    pub calibration_crc: u32,
    /// Learned state.
    pub state: HealthState,
}

impl Record<'_> for HealthRecord {
    const KIND: RecordKind = RecordKind::Health;
    const SCHEMA: u16 = 2;
}

impl HealthRecord {
    /// The state, if it was learned with this calibration; otherwise health is learned anew.
    #[must_use]
    pub fn for_calibration(&self, crc: u32) -> Option<&HealthState> {
        (self.calibration_crc == crc).then_some(&self.state)
    }
}

impl Record<'_> for FaultMemory {
    const KIND: RecordKind = RecordKind::Faults;
    const SCHEMA: u16 = 1;
}

/// Operating counters: operating time, starts and resets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct OperatingCounters {
    /// Operating time of the controller, in seconds; up to the last write before a power cut.
    pub operating_s: u32,
    /// Number of starts.
    pub starts: u32,
    /// Cause of the last start.
    pub last_reset: ResetCause,
    /// Unplanned resets: brown-out, watchdog, panic.
    pub unplanned_resets: u32,
}

impl OperatingCounters {
    /// All counters zero.
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

    /// Adds operating time.
    pub fn add_operating_time(&mut self, seconds: u32) {
        self.operating_s = self.operating_s.saturating_add(seconds);
    }
}

impl Record<'_> for OperatingCounters {
    const KIND: RecordKind = RecordKind::OperatingCounters;
    const SCHEMA: u16 = 1;
}
