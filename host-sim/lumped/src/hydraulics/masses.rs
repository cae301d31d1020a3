//! Masses of all chambers and nodes, and the flows integrated with them.

use crate::layout::{GROUPS, NODES};
use crate::simd::F64x4;

/// Flows across the system boundary and through the ports, integrated with the masses; the constants below index them.
pub const FLOWS: usize = 8;
/// Charge pump into the gallery.
pub const CHARGE_FLOW: usize = 0;
/// Relief valves 4 and 10 to the case.
pub const RELIEF_FLOW: usize = 1;
/// Leakage of the pump's chambers to the case.
pub const PUMP_LEAKAGE: usize = 2;
/// Leakage of the motor's chambers.
pub const MOTOR_LEAKAGE: usize = 3;
/// Pump chambers into line A.
pub const PUMP_TO_A: usize = 4;
/// Pump chambers into line B.
pub const PUMP_TO_B: usize = 5;
/// Motor chambers into line A.
pub const MOTOR_TO_A: usize = 6;
/// Motor chambers into line B.
pub const MOTOR_TO_B: usize = 7;

/// Masses of all chambers and nodes with the integrated flows, or the rates of both.
#[derive(Debug, Clone, Copy)]
pub struct Masses {
    /// Chambers, pump first.
    pub chamber: [F64x4; GROUPS],
    /// Lines and galleries.
    pub node: [f64; NODES],
    /// Integrated flows (or flows).
    pub flow: [f64; FLOWS],
}

impl Default for Masses {
    fn default() -> Self {
        Self { chamber: [F64x4::ZERO; GROUPS], node: [0.0; NODES], flow: [0.0; FLOWS] }
    }
}
