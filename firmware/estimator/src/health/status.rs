//! Health status as every estimate carries it.

use serde::{Deserialize, Serialize};

use super::fault_debounce::DtcStatus;
use super::fault_isolation::Causes;
use super::steady_gate::GateClosed;
use super::tuning::LEVEL_SD_START;
use crate::units::{Micros, Ratio};

/// A detected change of the level.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LevelChange {
    /// Time of detection.
    pub time: Micros,
    /// Level before: leakage over the law's.
    pub from: Ratio,
    /// Level after.
    pub to: Ratio,
    /// Whether it was detected as a step, by the cumulative sum, or as a drift.
    pub step: bool,
}

/// Health status after a sample: level, changes, possible causes and diagnostic faults.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Health {
    /// Whether the last full block was used, or the reason why not; an invalid sample closes the gate at once.
    pub gate: Result<(), GateClosed>,
    /// Level: leakage over the law's.
    pub level: Ratio,
    /// Standard error of the level, including possible wear since the last used block and what no driving averages out:
    /// systematic errors of pressure and temperature, misfit of the law.
    pub level_se: Ratio,
    /// Ratio offset: factor on the ratio that is not leakage, less 1.
    pub ratio_offset: Ratio,
    /// Number of changes reported since the state was reset.
    pub changes: u16,
    /// Causes that remain possible for the last change; empty without a change or before the isolation.
    pub causes: Causes,
    /// Diagnostic fault "wear": the machine leaks more than it did, and nothing but leakage explains it.
    pub wear: DtcStatus,
    /// Diagnostic fault "sensor": a sensor, the displacement or the oil explains a change, and leakage does not.
    pub sensor: DtcStatus,
}

impl Health {
    /// Before anything was learned.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            gate: Err(GateClosed::Filling),
            level: Ratio(1.0),
            level_se: Ratio(LEVEL_SD_START),
            ratio_offset: Ratio(0.0),
            changes: 0,
            causes: Causes::none(),
            wear: DtcStatus::Absent,
            sensor: DtcStatus::Absent,
        }
    }
}

impl Default for Health {
    fn default() -> Self {
        Self::new()
    }
}
