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
//! follows ([`crate::record::state`]). The work for a block is spread over the samples after it, one stage each, so that no
//! sample pays for all of it (`stages`). `docs/health/theory.md` states gate, recursion and thresholds, and what `host-sim evaluate`
//! measured.

mod averaging;
mod block_update;
mod context;
mod cusum;
mod diagnosis;
mod drift;
mod fault_debounce;
mod fault_isolation;
mod params;
mod pipeline;
mod prognosis;
mod r_statistic;
mod state;
mod status;
mod steady_gate;
mod tuning;
mod ud_rls;

pub(crate) use averaging::Terms;
pub(crate) use context::HealthContext;
pub use fault_debounce::{Stage, Trouble};
pub use fault_isolation::{CAUSES, Cause, Causes};
pub(crate) use params::MachineParts;
pub use params::{HealthParams, Severity};
pub use prognosis::{Remaining, Slope};
pub use state::HealthState;
pub use status::{Change, Health};
pub use steady_gate::Closed;
