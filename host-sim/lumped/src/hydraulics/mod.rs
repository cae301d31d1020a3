//! Mass balances of all chambers and nodes at one instant, solved implicitly.
//!
//! `stage` places the chambers (volumes, port areas) and makes the first guess, `newton` solves the balances with the
//! chambers eliminated, `nodes` holds the circuit's valves and the 4 x 4 system of the nodes. Derivation:
//! docs/full-model/integration.md.

mod masses;
mod newton;
mod nodes;
mod stage;

pub use masses::{
    CHARGE_FLOW, FLOWS, MOTOR_LEAKAGE, MOTOR_TO_A, MOTOR_TO_B, Masses, PUMP_LEAKAGE, PUMP_TO_A, PUMP_TO_B,
    RELIEF_FLOW,
};
pub use newton::NotConverged;
pub use stage::{ImplicitStage, Kinematics};
