//! The full lumped-parameter model of pump, motor and circuit.
pub mod error;
pub mod hydraulics;
pub mod integrator;
pub mod lanes;
pub mod observers;
pub mod oil;
pub mod plant;
pub mod run;
pub mod shaft;
pub mod steady;
pub mod tableau;
pub mod valve_plate;
pub mod valves;
