//! Health status as every estimate carries it.

use serde::{Deserialize, Serialize};

use super::fault_debounce::Stage;
use super::fault_isolation::Causes;
use super::steady_gate::Closed;
use super::tuning::LEVEL_SD_START;
use crate::units::{Micros, Ratio};

/// A change that was found.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Change {
    /// When it was found.
    pub time: Micros,
    /// Level before, leakage over the law's.
    pub from: Ratio,
    /// Level found.
    pub to: Ratio,
    /// Whether it came as a step, found by the cumulative sum, or as a drift.
    pub step: bool,
}

/// What the learned state says after a sample.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Health {
    /// Whether the last full block was used, or why not; a sample that cannot be used closes the gate at once.
    pub gate: Result<(), GateClosed>,
    /// Level: leakage over the law's.
    pub level: Ratio,
    /// Standard error of the level, with what the time since the last used block may have changed and what no driving
    /// averages out: systematic errors of pressure and temperature, misfit of the law.
    pub level_se: Ratio,
    /// Factor on the ratio that is not leakage, less 1.
    pub ratio_offset: Ratio,
    /// Number of changes reported since the state was reset.
    pub changes: u16,
    /// Causes that remain for the last change; empty when there was none or nothing is known yet.
    pub causes: Causes,
    /// Trouble: the machine leaks more than it did, and nothing but leakage explains it.
    pub wear: Stage,
    /// Trouble: a sensor, the displacement or the oil explains a change, and leakage does not.
    pub sensor: Stage,
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
