//! Machine parameters of the identification: what the reduced model and the calibration need to know of a drive.
//!
//! A struct of plain numbers, so that the identification does not depend on the machine file of one plant model. A machine
//! file of the lumped model converts into it (`impl From<&kou_lumped::machine::Machine>`).

use kou_estimator::model::flow_balance::ReducedConfig;
use kou_estimator::model::oil_compression::OilConfig;
use kou_estimator::units::{Celsius, CubicCentimetre, CubicCentimetrePerRev, Megapascal};
use kou_records::{AllowedRange, InputError};

use crate::convert::single;
use crate::plant_model::MachineCorrection;

/// Valid factors of a correction.
const FACTOR: AllowedRange = AllowedRange::new(0.5, 2.0, "");

/// Axial-piston unit: pump or motor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HydraulicUnit {
    /// Number of pistons.
    pub pistons: usize,
    /// Displacement per revolution.
    pub displacement_cm3_per_rev: f64,
    /// Dead volume of one chamber.
    pub dead_volume_cm3: f64,
}

/// Receiver of the pump's flow, to which the speed ratio refers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RatioReference {
    /// Motor, whose speed is measured.
    Motor(HydraulicUnit),
    /// Flow meter; flow is converted to a speed with a reference displacement.
    FlowMeter {
        /// Displacement per revolution of the equivalent motor.
        reference_displacement_cm3_per_rev: f64,
    },
}

/// Compressibility of the oil: bulk modulus with entrained air and temperature dependence.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OilCompressibility {
    /// Bulk modulus of the air-free oil at the reference temperature.
    pub bulk_modulus_mpa: f64,
    /// Volume fraction of free air at atmospheric pressure.
    pub air_fraction: f64,
    /// Polytropic exponent of the air.
    pub heat_capacity_ratio: f64,
    /// Relative change of the bulk modulus per kelvin.
    pub bulk_modulus_per_k: f64,
    /// Reference temperature.
    pub reference_c: f64,
}

/// Parameters of one drive.
#[derive(Debug, Clone, PartialEq)]
pub struct MachineParameters {
    /// Name of the machine, for the calibration.
    pub name: String,
    /// Pump.
    pub pump: HydraulicUnit,
    /// Motor or flow meter.
    pub reference: RatioReference,
    /// Oil.
    pub oil: OilCompressibility,
    /// Low pressure, gauge, where it is not measured.
    pub low_pressure_mpa: f64,
    /// Case pressure, gauge.
    pub case_pressure_mpa: f64,
}

impl From<&MachineParameters> for MachineParameters {
    fn from(machine: &MachineParameters) -> Self {
        machine.clone()
    }
}

fn check_factor(what: &str, value: f64) -> Result<(), InputError> {
    if FACTOR.contains(value) {
        Ok(())
    } else {
        Err(InputError::new(format!("{what} is out of range")).with_value(value).with_allowed(FACTOR))
    }
}

impl MachineParameters {
    /// Parameters of the corrected machine.
    ///
    /// # Errors
    /// Factors outside 0.5 to 2.
    pub fn corrected(&self, correction: MachineCorrection) -> Result<Self, InputError> {
        check_factor("factor of the pump's displacement", correction.displacement)?;
        check_factor("factor of the bulk modulus", correction.bulk)?;
        let mut machine = self.clone();
        machine.pump.displacement_cm3_per_rev *= correction.displacement;
        machine.pump.dead_volume_cm3 *= correction.displacement;
        machine.oil.bulk_modulus_mpa *= correction.bulk;
        Ok(machine)
    }

    /// Displacement to which the speed ratio refers: the motor's, or the flow meter's reference.
    #[must_use]
    pub const fn reference_displacement_cm3_per_rev(&self) -> f64 {
        match self.reference {
            RatioReference::Motor(motor) => motor.displacement_cm3_per_rev,
            RatioReference::FlowMeter { reference_displacement_cm3_per_rev } => {
                reference_displacement_cm3_per_rev
            }
        }
    }

    /// Oil parameters of the estimator.
    #[must_use]
    pub fn oil_config(&self) -> OilConfig {
        let oil = &self.oil;
        OilConfig {
            bulk_modulus_mpa: single(oil.bulk_modulus_mpa),
            air_fraction: single(oil.air_fraction),
            heat_capacity_ratio: single(oil.heat_capacity_ratio),
            bulk_modulus_per_k: single(oil.bulk_modulus_per_k),
            reference: Celsius(single(oil.reference_c)),
        }
    }

    /// Constants of the reduced model by theory: geometry of the machine, half of all chambers leaking.
    #[must_use]
    pub fn reduced_config(&self) -> ReducedConfig {
        let pump = &self.pump;
        let (motor_dead_cm3, motor_pistons) = match self.reference {
            RatioReference::Motor(motor) => (motor.dead_volume_cm3 * motor.pistons as f64, motor.pistons),
            RatioReference::FlowMeter { .. } => (0.0, 0),
        };
        ReducedConfig {
            pump_displacement: CubicCentimetrePerRev(single(pump.displacement_cm3_per_rev)),
            pump_dead_volume: CubicCentimetre(single(pump.dead_volume_cm3 * pump.pistons as f64)),
            motor_displacement: CubicCentimetrePerRev(single(self.reference_displacement_cm3_per_rev())),
            motor_dead_volume: CubicCentimetre(single(motor_dead_cm3)),
            leaking_chambers: single((pump.pistons + motor_pistons) as f64 / 2.0),
            fewer_leaking_per_rpm: 0.0,
            fewer_leaking_per_root_mpa: 0.0,
            groove_flow: 0.0,
            case_pressure: Megapascal(single(self.case_pressure_mpa)),
        }
    }
}
