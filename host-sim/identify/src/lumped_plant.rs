//! Lumped model behind the [`PlantModel`] interface; the only file of this crate that calls its solver.

use kou_lumped::machine::{FlowReceiver, Machine, PistonUnit};
use kou_lumped::{LumpedModel, OperatingPoint, SimError, SolverSettings, SteadyCase, SteadyPoint};
use kou_records::InputError;

use crate::machine_parameters::{HydraulicUnit, MachineParameters, OilCompressibility, RatioReference};
use crate::plant_model::{MachineCorrection, PlantError, PlantModel, SteadyResponse};

/// Lumped model of a machine.
#[derive(Debug)]
#[doc(alias = "full model")]
pub struct LumpedPlant {
    model: LumpedModel,
    file: Machine,
    settings: SolverSettings,
}

impl LumpedPlant {
    /// Lumped model of a machine.
    ///
    /// # Errors
    /// A machine file without the parts that the lumped model needs.
    pub fn new(machine: &Machine) -> Result<Self, InputError> {
        Self::with_correction(machine, machine.clone())
    }

    fn with_correction(file: &Machine, corrected: Machine) -> Result<Self, InputError> {
        let model = LumpedModel::new(&corrected).map_err(input_error)?;
        Ok(Self { model, file: file.clone(), settings: SolverSettings::default() })
    }
}

/// Machine of the lumped model with a correction applied.
///
/// # Errors
/// Factors out of range.
pub fn corrected_machine(machine: &Machine, correction: MachineCorrection) -> Result<Machine, InputError> {
    machine
        .with_pump_displacement_factor(correction.displacement)
        .and_then(|machine| machine.with_bulk_modulus_factor(correction.bulk))
        .map_err(input_error)
}

fn input_error(error: impl std::fmt::Display) -> InputError {
    InputError::new(error.to_string())
}

fn plant_error(error: SimError) -> PlantError {
    match error {
        SimError::Unreachable { .. } => PlantError::Unreachable(error.to_string()),
        other => PlantError::Failed(other.to_string()),
    }
}

impl PlantModel for LumpedPlant {
    fn solve(&self, at: &OperatingPoint, kou: f64) -> Result<SteadyResponse, PlantError> {
        let case = SteadyCase::at(at, kou);
        let point = match SteadyPoint::solve_with(&self.model, &case, &self.settings) {
            // Near a slow beat of the ripples of pump and motor the default tolerance takes many windows: four times the
            // tolerance is sufficient here.
            Err(SimError::NotSteady { .. }) => {
                let coarse = SolverSettings { tolerance: 4.0 * self.settings.tolerance, ..self.settings };
                SteadyPoint::solve_with(&self.model, &case, &coarse)
            }
            other => other,
        }
        .map_err(plant_error)?;
        Ok(SteadyResponse { ratio: point.ratio, p_l_mpa: point.p_l_mpa })
    }

    fn corrected(&self, correction: MachineCorrection) -> Result<Box<dyn PlantModel + '_>, InputError> {
        Ok(Box::new(Self::with_correction(&self.file, corrected_machine(&self.file, correction)?)?))
    }
}

impl From<&PistonUnit> for HydraulicUnit {
    fn from(unit: &PistonUnit) -> Self {
        Self {
            pistons: unit.pistons,
            displacement_cm3_per_rev: unit.displacement_cm3_per_rev,
            dead_volume_cm3: unit.dead_volume_cm3,
        }
    }
}

impl From<&Machine> for MachineParameters {
    fn from(machine: &Machine) -> Self {
        let oil = machine.oil();
        Self {
            name: machine.name().to_string(),
            pump: machine.pump().into(),
            reference: match machine.receiver() {
                FlowReceiver::Motor(motor) => RatioReference::Motor(motor.into()),
                FlowReceiver::FlowMeter(meter) => RatioReference::FlowMeter {
                    reference_displacement_cm3_per_rev: meter.reference_displacement_cm3_per_rev,
                },
            },
            oil: OilCompressibility {
                bulk_modulus_mpa: oil.bulk_modulus_mpa,
                air_fraction: oil.air_fraction,
                heat_capacity_ratio: oil.heat_capacity_ratio,
                bulk_modulus_per_k: oil.bulk_modulus_per_k,
                reference_c: oil.reference_c,
            },
            low_pressure_mpa: machine.circuit().low_pressure_mpa,
            case_pressure_mpa: machine.circuit().case_pressure_mpa,
        }
    }
}
