//! The machine file: everything about one rig or drive that a person types in, checked once.
//!
//! A [`Machine`] can only come out of [`Machine::load`] or [`Machine::from_toml`], so whoever holds one holds values
//! inside their ranges and consistent with each other. Units stand in the keys of the file and in the field names.
//! The identification with the reduced model needs little: the oil's compressibility, two pressures, and displacement,
//! pistons and dead volume of the pump and of the motor (or a flow meter in its place). Valve plates, circuit dynamics
//! and inertia are optional in the file; [`Machine::full`] demands them all and names what is missing.
//!
//! Limits: one pump, one motor, one oil; each unit has equally spaced pistons of one size.

mod check;
mod parts;
mod plate_table;
mod raw;

use std::path::Path;

pub use parts::{
    Case, ChargeDrive, ChargePump, CheckValve, Circuit, CircuitDynamics, FlowMeter, Friction, FullParts,
    Groove, Oil, PlateGeometry, PlateTable, Receiver, Relief, Shuttle, Swash, Unit, ValvePlate,
};

use crate::input::{InvalidInput, TomlFile};

/// Version of the machine file's layout that this program reads.
pub const SCHEMA: i64 = 1;

/// One checked machine: oil, circuit, pump, and what receives the pump's flow.
#[derive(Debug, Clone, PartialEq)]
pub struct Machine {
    name: String,
    oil: Oil,
    circuit: Circuit,
    pump: Unit,
    receiver: Receiver,
}

impl Machine {
    /// Reads and checks a machine file.
    ///
    /// # Errors
    /// Any key that is missing, unknown, of the wrong type or outside its range, with file, line and allowed range.
    pub fn load(path: &Path) -> Result<Self, InvalidInput> {
        Self::from_toml(&TomlFile::read(path)?)
    }

    /// Checks a machine file that is already in memory. Table files that it names are looked up beside it.
    ///
    /// # Errors
    /// As [`Machine::load`].
    pub fn from_toml(file: &TomlFile) -> Result<Self, InvalidInput> {
        check::machine(file)
    }

    /// Name of the machine, for reports.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Oil properties.
    #[must_use]
    pub fn oil(&self) -> &Oil {
        &self.oil
    }

    /// Circuit: pressures, and the dynamics when the file has them.
    #[must_use]
    pub fn circuit(&self) -> &Circuit {
        &self.circuit
    }

    /// Pump.
    #[must_use]
    pub fn pump(&self) -> &Unit {
        &self.pump
    }

    /// Motor or flow meter at the other end of the high line.
    #[must_use]
    pub fn receiver(&self) -> &Receiver {
        &self.receiver
    }

    /// Motor, when the rig has one.
    #[must_use]
    pub fn motor(&self) -> Option<&Unit> {
        match &self.receiver {
            Receiver::Motor(motor) => Some(motor),
            Receiver::FlowMeter(_) => None,
        }
    }

    /// Displacement, per revolution, to which the speed ratio refers: the motor's, or the flow meter's.
    #[must_use]
    pub fn reference_displacement_cm3_per_rev(&self) -> f64 {
        match &self.receiver {
            Receiver::Motor(motor) => motor.displacement_cm3_per_rev,
            Receiver::FlowMeter(meter) => meter.reference_displacement_cm3_per_rev,
        }
    }

    /// The same machine with another pump displacement; stroke and dead volume keep their ratio to each other.
    ///
    /// # Errors
    /// When the factor is not between 0.5 and 2.
    pub fn with_pump_displacement_factor(&self, factor: f64) -> Result<Self, InvalidInput> {
        check::factor("factor of the pump's displacement", factor)?;
        let mut machine = self.clone();
        machine.pump.displacement_cm3_per_rev *= factor;
        machine.pump.dead_volume_cm3 *= factor;
        Ok(machine)
    }

    /// The same machine with the oil's bulk modulus multiplied by a factor.
    ///
    /// # Errors
    /// When the factor is not between 0.5 and 2.
    pub fn with_bulk_modulus_factor(&self, factor: f64) -> Result<Self, InvalidInput> {
        check::factor("factor of the bulk modulus", factor)?;
        let mut machine = self.clone();
        machine.oil.bulk_modulus_mpa *= factor;
        Ok(machine)
    }

    /// Everything the full model needs beyond the reduced model.
    ///
    /// # Errors
    /// Names every part that the file lacks.
    pub fn full(&self) -> Result<FullParts<'_>, InvalidInput> {
        parts::full(self)
    }
}

#[cfg(test)]
mod tests;
