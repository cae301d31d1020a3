//! State of the drive and the inputs that act on it.

use crate::hydraulics::{FLOWS, Masses};
use crate::layout::{GROUPS, LANES, NODES};
use crate::plant::Plant;
use crate::shaft::{ShaftDrive, ShaftLoad};
use crate::simd::{F64x4, WIDTH};

/// Inputs that act on the drive during a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlantInputs {
    /// Drive of the pump.
    pub drive: ShaftDrive,
    /// Load on the motor.
    pub load: ShaftLoad,
    /// Commanded displacement fraction.
    pub alpha: f64,
}

/// State of the drive at one instant.
#[derive(Debug, Clone)]
pub struct PlantState {
    /// Time.
    pub time_s: f64,
    /// Masses of chambers and nodes, kg; its flows are integrals since the start, kg.
    pub masses: Masses,
    /// Shaft angle of the pump since the start.
    pub phi_p_rad: f64,
    /// Shaft angle of the motor since the start.
    pub phi_m_rad: f64,
    /// Pump speed.
    pub omega_p_rad_s: f64,
    /// Motor speed.
    pub omega_m_rad_s: f64,
    /// Displacement fraction.
    pub alpha: f64,
    /// Torque of the oil on the pump's shaft.
    pub torque_p_nm: f64,
    /// Torque of the oil on the motor's shaft.
    pub torque_m_nm: f64,
    /// Absolute pressures of the chambers, Pa.
    pub p_chamber_pa: [F64x4; GROUPS],
    /// Absolute pressures of the nodes, Pa.
    pub p_node_pa: [f64; NODES],
    /// Rates at this instant: explicit first stage of the next step.
    pub(crate) rates: Masses,
    pub(crate) rates_known: bool,
}

impl PlantState {
    /// Oil stored in chambers and nodes, kg.
    #[must_use]
    pub fn stored_kg(&self, plant: &Plant) -> f64 {
        let chambers: f64 = (0..plant.chambers().min(LANES))
            .map(|lane| self.masses.chamber[lane / WIDTH].0[lane % WIDTH])
            .sum();
        chambers + self.masses.node.iter().sum::<f64>()
    }

    /// Flows at this instant, kg/s; zero before the first step.
    #[must_use]
    pub fn flows_kg_s(&self) -> [f64; FLOWS] {
        self.rates.flow
    }

    /// Discards the rates; necessary after any edit of the state.
    pub fn restart(&mut self) {
        self.rates_known = false;
    }
}
