//! Mass balance of the drive between two instants.

use crate::hydraulics::{
    CHARGE_FLOW, FLOWS, MOTOR_LEAKAGE, MOTOR_TO_A, MOTOR_TO_B, PUMP_LEAKAGE, PUMP_TO_A, PUMP_TO_B,
    RELIEF_FLOW,
};
use crate::plant::Plant;
use crate::plant_state::PlantState;

/// Mass balance from an initial state on: inflow, outflow and stored mass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MassBalance {
    stored_kg: f64,
    flow_kg: [f64; FLOWS],
}

impl MassBalance {
    /// Balance that begins at `state`.
    #[must_use]
    pub fn from(state: &PlantState, plant: &Plant) -> Self {
        Self { stored_kg: state.stored_kg(plant), flow_kg: state.masses.flow }
    }

    /// Oil that the pump and the motor moved through their ports since the beginning, kg.
    #[must_use]
    pub fn pumped_kg(&self, state: &PlantState) -> f64 {
        [PUMP_TO_A, PUMP_TO_B, MOTOR_TO_A, MOTOR_TO_B]
            .into_iter()
            .map(|k| (state.masses.flow[k] - self.flow_kg[k]).abs())
            .fold(0.0, f64::max)
    }

    /// |inflow - outflow - change of stored mass| over the pumped mass.
    #[must_use]
    pub fn error(&self, state: &PlantState, plant: &Plant) -> f64 {
        let since = |k: usize| state.masses.flow[k] - self.flow_kg[k];
        let inflow = since(CHARGE_FLOW);
        let outflow = since(RELIEF_FLOW) + since(PUMP_LEAKAGE) + since(MOTOR_LEAKAGE);
        let change = state.stored_kg(plant) - self.stored_kg;
        (inflow - outflow - change).abs() / self.pumped_kg(state).max(f64::MIN_POSITIVE)
    }
}
