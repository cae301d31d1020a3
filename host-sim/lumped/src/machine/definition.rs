//! Machine: oil, circuit, pump and the receiver of its flow, checked.

use crate::invalid_input::InvalidInput;
use crate::value_range::ValueRange;

use super::parts::{Circuit, FlowReceiver, LumpedParts, OilProperties, PistonUnit};

/// Factors by which a machine's property may be scaled.
const FACTOR: ValueRange = ValueRange::new(0.5, 2.0, "");

/// Machine of a checked machine file: every value lies in its range and fits the others.
#[derive(Debug, Clone, PartialEq)]
pub struct Machine {
    pub(super) name: String,
    pub(super) oil: OilProperties,
    pub(super) circuit: Circuit,
    pub(super) pump: PistonUnit,
    pub(super) receiver: FlowReceiver,
    pub(super) missing_for_lumped_model: Vec<String>,
}

impl Machine {
    /// Name of the machine, for reports.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Oil properties.
    #[must_use]
    pub fn oil(&self) -> &OilProperties {
        &self.oil
    }

    /// Circuit.
    #[must_use]
    pub fn circuit(&self) -> &Circuit {
        &self.circuit
    }

    /// Pump.
    #[must_use]
    pub fn pump(&self) -> &PistonUnit {
        &self.pump
    }

    /// Motor or flow meter at the other end of the high line.
    #[must_use]
    pub fn receiver(&self) -> &FlowReceiver {
        &self.receiver
    }

    /// Motor, when the rig has one.
    #[must_use]
    pub fn motor(&self) -> Option<&PistonUnit> {
        match &self.receiver {
            FlowReceiver::Motor(motor) => Some(motor),
            FlowReceiver::FlowMeter(_) => None,
        }
    }

    /// Displacement to which the speed ratio refers: the motor's, or the flow meter's.
    #[must_use]
    pub fn reference_displacement_cm3_per_rev(&self) -> f64 {
        match &self.receiver {
            FlowReceiver::Motor(motor) => motor.displacement_cm3_per_rev,
            FlowReceiver::FlowMeter(meter) => meter.reference_displacement_cm3_per_rev,
        }
    }

    /// Machine with the pump's displacement scaled by a factor; the dead volume is scaled with it.
    ///
    /// # Errors
    /// When the factor is not between 0.5 and 2.
    pub fn with_pump_displacement_factor(&self, factor: f64) -> Result<Self, InvalidInput> {
        check_factor("factor of the pump's displacement", factor)?;
        let mut machine = self.clone();
        machine.pump.displacement_cm3_per_rev *= factor;
        machine.pump.dead_volume_cm3 *= factor;
        Ok(machine)
    }

    /// Machine with the oil's bulk modulus scaled by a factor.
    ///
    /// # Errors
    /// When the factor is not between 0.5 and 2.
    pub fn with_bulk_modulus_factor(&self, factor: f64) -> Result<Self, InvalidInput> {
        check_factor("factor of the bulk modulus", factor)?;
        let mut machine = self.clone();
        machine.oil.bulk_modulus_mpa *= factor;
        Ok(machine)
    }

    /// Everything that the lumped model needs beyond the reduced model.
    ///
    /// # Errors
    /// Names every part that the file lacks.
    pub fn lumped_parts(&self) -> Result<LumpedParts<'_>, InvalidInput> {
        self.complete_parts().ok_or_else(|| {
            InvalidInput::new(format!(
                "the lumped model of machine `{}` needs {}, which its file does not have",
                self.name,
                self.missing_for_lumped_model.join(", ")
            ))
        })
    }

    fn complete_parts(&self) -> Option<LumpedParts<'_>> {
        let motor = self.motor()?;
        Some(LumpedParts {
            dynamics: self.circuit.dynamics.as_ref()?,
            pump_plate: self.pump.valve_plate.as_ref()?,
            swash: self.pump.swash?,
            motor,
            motor_plate: motor.valve_plate.as_ref()?,
            motor_inertia_kg_m2: motor.inertia_kg_m2?,
        })
    }
}

fn check_factor(what: &str, value: f64) -> Result<(), InvalidInput> {
    if FACTOR.contains(value) { Ok(()) } else { Err(InvalidInput::out_of_range(what, value, FACTOR)) }
}
