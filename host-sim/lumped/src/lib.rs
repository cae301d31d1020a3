//! Lumped-parameter model of an axial-piston pump and motor in closed circuit: a hydrostatic drive, chamber by chamber.
//!
//! Every piston chamber, both lines, the charge gallery and the flushing gallery hold a mass of compressible oil at one
//! pressure each; ports, valves, leakage gaps, shafts and the swash actuator connect them. The mass balances form a
//! stiff system of ordinary differential equations, which an L-stable implicit Runge-Kutta method integrates at fixed
//! steps of pump angle. Results: the speed ratio of a steady operating point, the response to a swash step, waveforms
//! of every pressure, flow and torque.
//!
//! # Example
//!
//! Steady state of the reference machine at 2000 r/min and 36.5 MPa, first without leakage, then with a leakage
//! coefficient (Kou) of 0.1 (L/min)/MPa in every chamber:
//!
//! ```
//! use std::path::Path;
//!
//! use kou_lumped::{LumpedModel, Machine, OperatingPoint, SteadyCase, SteadyPoint};
//!
//! # fn main() -> Result<(), kou_lumped::SimError> {
//! let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../machines/reference.toml");
//! let model = LumpedModel::new(&Machine::load(&file)?)?;
//! let point = OperatingPoint { n_p_rpm: 2000.0, p_h_mpa: 36.5, p_l_mpa: None, t_b_c: 60.0, alpha: 1.0 };
//! let tight = SteadyPoint::solve(&model, &SteadyCase::at(&point, 0.0))?;
//! let worn = SteadyPoint::solve(&model, &SteadyCase::at(&point, 0.1))?;
//! // Motor speed over pump speed: compression costs 3.9 %, leakage another 5.2 %.
//! assert!((tight.ratio - 0.961).abs() < 0.001, "{}", tight.ratio);
//! assert!((worn.ratio - 0.909).abs() < 0.001, "{}", worn.ratio);
//! # Ok(())
//! # }
//! ```
//!
//! # Reading order
//!
//! | step | modules |
//! |---|---|
//! | machine file | [`machine`] |
//! | parameters at one oil temperature and leakage coefficient | [`model`], [`plant`] |
//! | elements | [`oil`], [`valve_plate`], [`valves`], [`shaft`] |
//! | mass balances of one instant, solved by Newton's method | [`hydraulics`] |
//! | one time step, many time steps | [`tableau`], [`plant_state`], [`integrator`], [`stepping`] |
//! | averages and checks while stepping | [`averaging`], [`mass_balance`], [`waveforms`] |
//! | results | [`steady`], [`transient`] |
//!
//! Inside the model everything is SI and pressures are absolute; at every interface pressures are gauge, in MPa, and
//! field names carry the unit. Derivations, one page per element: `docs/full-model`.
//!
//! # Limits
//!
//! One pressure per chamber and line (no waves in pipes), one oil temperature, quasi-static valves, rigid parts,
//! leakage only from chambers to the case. The model shares no equation with the controller's estimator, so it can
//! serve as the estimator's independent reference.

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
pub mod shaft;
pub mod simd;
pub mod steady;
pub mod stepping;
pub mod tableau;
pub mod transient;
pub mod value_range;
pub mod valve_plate;
pub mod valves;
pub mod waveforms;

pub use error::SimError;
pub use invalid_input::InvalidInput;
pub use machine::Machine;
pub use model::LumpedModel;
pub use operating_point::OperatingPoint;
pub use plant::Plant;
pub use steady::{LoadCondition, SolverSettings, SteadyCase, SteadyPoint};
pub use value_range::ValueRange;
