//! Machine file: the parameters of one drive or test rig, read from TOML and checked.
//!
//! [`Machine::load`] is the way in; every value of a [`Machine`] lies in its range and fits the others. Keys and field
//! names carry the unit. [`FIELDS`] describes every field; `docs/full-model/machine.md` prints it. Valve plates,
//! circuit dynamics, swash actuator and inertia are optional, because a reduced model does without them;
//! [`Machine::lumped_parts`] demands them and names the missing ones.
//!
//! Limits: one pump, one motor, one oil; equally spaced pistons of one size.

mod definition;
mod fields;
mod load;
mod parts;
mod plate_table;
mod reader;
mod source;

pub use definition::Machine;
pub use fields::{FIELDS, FieldKind, FieldNeed, MachineField, SCHEMA};
pub use parts::{
    ChargeDrive, ChargePump, Circuit, CircuitDynamics, FlowMeter, FlowReceiver, LumpedParts, OilProperties,
    OpeningValve, PistonUnit, PlateGeometry, PlateTable, PortAreas, ReliefValve, ShaftFriction,
    SilencingGroove, SwashActuator, ValvePlate,
};

#[cfg(test)]
mod tests;
