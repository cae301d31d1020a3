//! Periodic steady state, solved directly: the speed ratio at a given high pressure or load, with its residual.
//!
//! `ratio_search` corrects the ratio until the high line neither fills nor empties; `ensemble` averages over the
//! relative positions of the two shafts. Derivation: docs/full-model/steady.md.

mod case;
mod ensemble;
mod point;
mod ratio_search;
mod settings;
mod solve;

pub use case::{LoadCondition, SteadyCase};
pub use point::SteadyPoint;
pub use settings::SolverSettings;
pub use solve::{HIGH_PRESSURE, LOAD, SPEED, STEP};
