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

pub mod error;
pub mod hydraulics;
pub mod input;
pub mod integrator;
pub mod lanes;
pub mod machine;
pub mod observers;
pub mod oil;
pub mod operating_point;
pub mod plant;
pub mod run;
pub mod shaft;
pub mod steady;
pub mod tableau;
pub mod transient;
pub mod valve_plate;
pub mod valves;
pub mod waveforms;

pub use error::SimError;
pub use input::{InvalidInput, Range, TomlFile};
pub use operating_point::OperatingPoint;
pub use plant::{Model, Plant};
pub use steady::{LoadCondition, Settings, SteadyCase, SteadyPoint};
