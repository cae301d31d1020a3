//! The full lumped-parameter model of pump, motor and circuit: the referee of everything the estimator says.
//!
//! Walk through it in this order: machine file ([`crate::machine`]) -> [`plant`], the machine prepared for one oil
//! temperature and leakage coefficient -> elements ([`oil`], [`valve_plate`], [`valves`], [`shaft`]) -> [`hydraulics`],
//! all mass balances of one instant solved implicitly -> [`integrator`], one step, and [`run`], many -> [`observers`],
//! what is measured -> results: [`steady`] (an operating point), [`transient`] (a step response), [`waveforms`] (what to
//! plot). Theory, one page per element: `docs/full-model`.
//!
//! Limits: one pressure per chamber and line (no waves in pipes), one oil temperature, quasi-static valves, leakage only
//! from chambers to the case. No equation is shared with the estimator, on purpose.

pub mod averaging;
pub mod error;
pub mod hydraulics;
pub mod integrator;
pub mod invalid_input;
pub mod layout;
pub mod machine;
pub mod mass_balance;
pub mod model;
pub mod oil;
pub mod operating_point;
pub mod plant;
pub mod plant_state;
pub mod range;
pub mod shaft;
pub mod simd;
pub mod steady;
pub mod stepping;
pub mod tableau;
pub mod transient;
pub mod valve_plate;
pub mod valves;
pub mod waveforms;

pub use error::SimError;
pub use invalid_input::InvalidInput;
pub use machine::Machine;
pub use model::LumpedModel;
pub use operating_point::OperatingPoint;
pub use plant::Plant;
pub use range::Range;
pub use steady::{LoadCondition, SolverSettings, SteadyCase, SteadyPoint};
