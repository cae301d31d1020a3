//! Health: what the leakage has become, slowly learned while driving, and whether it has changed.
//!
//! Every valid sample goes into a block (`block`); a block passes the gate when speed, pressure, displacement and ratio
//! are steady (`gate`, `steady`). The deficit of ratio of a block is explained by four parameters, learned recursively
//! (`ud`):
//!
//! * the level: leakage over the law's, less 1. It may change, so it is forgotten slowly;
//! * a factor on the ratio: displacement or speed scale, constant. It would otherwise look like a leak that depends on
//!   pressure: 1 % of ratio is 65 % of Kou at 10 MPa and 14 % at 45;
//! * slopes of the level with pressure and with temperature, constant: what the law misses of the machine.
//!
//! The level is watched in two ways: a two-sided cumulative sum of the deficit's innovations finds steps (`step_watch`), the
//! distance of the learned level from the reference finds drifts (`drift_watch`). A change found is reported, never
//! silently followed; then the causes are told apart by their signatures (`signature`, `judge`), and only where nothing but
//! leakage remains is wear confirmed.
//!
//! All of it is fixed in size, bounded in value, and the state can be saved and restored without changing a bit of what
//! follows ([`crate::state_record`]). The work for a block is spread over the samples after it, one stage each, so that no
//! sample pays for all of it (`stages`). `docs/health.md` states gate, recursion and thresholds, and what `host-sim evaluate`
//! measured.

mod block;
mod config;
mod drift_watch;
mod gate;
mod judge;
mod signature;
mod stages;
mod state;
mod steady;
mod step_watch;
mod trend;
mod trouble;
mod ud;

use serde::{Deserialize, Serialize};

use crate::units::{Micros, Ratio};
pub(crate) use block::Terms;
pub(crate) use config::MachineParts;
pub use config::{HealthConfig, HealthParams, Severity};
pub use gate::Closed;
pub use signature::{CAUSES, Cause, Causes};
pub use state::HealthState;
pub use trend::{Remaining, Slope};
pub use trouble::{Stage, Trouble};

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
            level_se: Ratio(state::LEVEL_SD_START),
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
