//! Health monitoring: recursive estimation of the leakage level, change detection, fault isolation, prognosis.
//!
//! Every valid sample contributes to a block mean (`averaging`); a block is used when speed, pressure, displacement and
//! ratio are steady (`steady_gate`, `r_statistic`). The ratio residual of a block is modelled by four parameters
//! (`block_regression`), estimated by recursive least squares (`ud_rls`):
//!
//! * the level: leakage over the law's, less 1. It may change, so it is forgotten slowly;
//! * the ratio offset: a constant factor on the ratio, of displacement or speed scale. It would otherwise look like a
//!   leak that depends on pressure: 1 % of ratio is 65 % of Kou at 10 MPa and 14 % at 45;
//! * slopes of the level with pressure and with temperature, constant: the law's misfit to this machine.
//!
//! Changes of the level are detected in two ways: steps by a two-sided cumulative sum of the innovations (`cusum`),
//! drifts by the distance of the level from a learned reference (`drift`). A detected change is reported, never
//! silently followed; then its causes are isolated by their signatures (`fault_isolation`, `diagnosis`), and wear is
//! confirmed only where nothing but leakage remains possible (`fault_debounce`).
//!
//! Size and values are bounded, and the state can be saved and restored bit for bit ([`crate::record::state`]). The
//! work for a block is spread over the samples after it, one stage each (`pipeline`). All constants of judgement are in
//! `tuning`. Theory and measured performance: `docs/health/theory.md`.

mod averaging;
mod block_regression;
mod block_update;
mod context;
pub mod cusum;
mod diagnosis;
mod drift;
mod fault_debounce;
mod fault_isolation;
mod params;
mod pipeline;
mod prognosis;
pub mod r_statistic;
mod state;
mod status;
mod steady_gate;
mod tuning;
pub mod ud_rls;

pub(crate) use averaging::RegressionSample;
pub(crate) use context::HealthContext;
pub use fault_debounce::{DiagnosticFault, DtcStatus};
pub use fault_isolation::{CAUSE_COUNT, Cause, Causes};
pub(crate) use params::HealthInputs;
pub use params::{HealthParams, Severity};
pub use prognosis::{RemainingLife, Slope};
pub use state::HealthState;
pub use status::{Health, LevelChange};
pub use steady_gate::GateClosed;
