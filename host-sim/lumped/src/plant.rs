//! Parameters of the equations for one machine at one oil temperature and leakage coefficient, in SI.
//!
//! Chambers occupy lanes, the pump's first, then the motor's, padded to a multiple of four with closed dummy chambers,
//! so that loops over chambers become vector instructions. Pressures are absolute.

use std::sync::Arc;

use crate::machine::{ChargeDrive, Machine, SwashActuator};

use crate::error::SimError;
use crate::layout::{GROUPS, NODES};
use crate::oil::{ATMOSPHERE_PA, OilTable};
use crate::simd::{F64x4, WIDTH};
use crate::valve_plate::{PortConductances, look_up, table_of};
use crate::valves::{CheckLaw, ReliefLaw, ShuttleLaw};

/// (L/min)/MPa in m3/s/Pa.
pub const L_MIN_MPA: f64 = 1.0 / 60_000.0 / 1.0e6;

/// Mass flow of charge pump 3.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ChargeFlow {
    constant_kg_s: f64,
    per_pump_rad_kg: f64,
}

impl ChargeFlow {
    /// Mass flow into the charge gallery at this speed of the main pump.
    #[inline(always)]
    pub(crate) fn kg_s(&self, omega_p_rad_s: f64) -> f64 {
        self.constant_kg_s + self.per_pump_rad_kg * omega_p_rad_s.abs()
    }
}

/// Machine at one oil temperature and leakage coefficient, ready for the integrator.
#[derive(Debug, Clone)]
pub struct Plant {
    pub(crate) groups: usize,
    pub(crate) pump_pistons: usize,
    pub(crate) motor_pistons: usize,
    /// 1 in lanes of the pump, 0 elsewhere.
    pub(crate) is_pump: [F64x4; GROUPS],
    pub(crate) dead_m3: [F64x4; GROUPS],
    pub(crate) half_stroke_m3: [F64x4; GROUPS],
    pub(crate) offset_rad: [F64x4; GROUPS],
    pub(crate) cos_offset: [F64x4; GROUPS],
    pub(crate) sin_offset: [F64x4; GROUPS],
    pub(crate) kou_m3_s_pa: [F64x4; GROUPS],
    pub(crate) ports: [PortConductances; GROUPS],
    pub(crate) pump_table: Option<Vec<[f64; 2]>>,
    pub(crate) motor_table: Option<Vec<[f64; 2]>>,
    pub(crate) oil: Arc<OilTable>,
    pub(crate) case_pa: f64,
    pub(crate) case_rho: f64,
    pub(crate) node_m3: [f64; NODES],
    pub(crate) charge: ChargeFlow,
    pub(crate) charge_relief: ReliefLaw,
    pub(crate) flushing_relief: ReliefLaw,
    pub(crate) high_relief: Option<ReliefLaw>,
    pub(crate) check_valve: CheckLaw,
    pub(crate) shuttle: ShuttleLaw,
    pub(crate) swash: SwashActuator,
    pub(crate) motor_inertia_kg_m2: f64,
    pub(crate) pump_inertia_kg_m2: Option<f64>,
    pub(crate) motor_friction: crate::machine::ShaftFriction,
    pub(crate) pump_friction: crate::machine::ShaftFriction,
    pub(crate) low_pa: f64,
    pub(crate) pump_m3_per_rad: f64,
    pub(crate) motor_m3_per_rad: f64,
}

impl Plant {
    pub(crate) fn new(machine: &Machine, oil: Arc<OilTable>, kou_l_min_mpa: f64) -> Result<Self, SimError> {
        let parts = machine.lumped_parts()?;
        let (pump, motor, dynamics) = (machine.pump(), parts.motor, parts.dynamics);
        let rho = oil.density_kg_m3();
        let per_rev = dynamics.charge_pump.displacement_cm3_per_rev * 1.0e-6 * rho;
        let charge = match dynamics.charge_pump.drive {
            ChargeDrive::OwnSpeedRpm(rpm) => {
                ChargeFlow { constant_kg_s: per_rev * rpm / 60.0, per_pump_rad_kg: 0.0 }
            }
            ChargeDrive::PumpShaftRatio(ratio) => {
                ChargeFlow { constant_kg_s: 0.0, per_pump_rad_kg: per_rev * ratio / std::f64::consts::TAU }
            }
        };
        let chambers = pump.pistons + motor.pistons;
        let case_pa = machine.circuit().case_pressure_mpa * 1.0e6 + ATMOSPHERE_PA;
        let mut plant = Self {
            groups: chambers.div_ceil(WIDTH).min(GROUPS),
            pump_pistons: pump.pistons,
            motor_pistons: motor.pistons,
            is_pump: [F64x4::ZERO; GROUPS],
            // Padding lanes are closed chambers of 10 cm3 that never move.
            dead_m3: [F64x4::all(1.0e-5); GROUPS],
            half_stroke_m3: [F64x4::ZERO; GROUPS],
            offset_rad: [F64x4::ZERO; GROUPS],
            cos_offset: [F64x4::all(1.0); GROUPS],
            sin_offset: [F64x4::ZERO; GROUPS],
            kou_m3_s_pa: [F64x4::ZERO; GROUPS],
            ports: [PortConductances::default(); GROUPS],
            pump_table: table_of(pump, rho),
            motor_table: table_of(motor, rho),
            case_pa,
            case_rho: oil.density_at(case_pa),
            node_m3: [
                dynamics.line_a_volume_cm3 * 1.0e-6,
                dynamics.line_b_volume_cm3 * 1.0e-6,
                dynamics.charge_gallery_volume_cm3 * 1.0e-6,
                dynamics.flushing_gallery_volume_cm3 * 1.0e-6,
            ],
            charge,
            charge_relief: ReliefLaw::new(&dynamics.charge_relief, rho),
            flushing_relief: ReliefLaw::new(&dynamics.flushing_relief, rho),
            high_relief: dynamics.high_relief.as_ref().map(|r| ReliefLaw::new(r, rho)),
            check_valve: CheckLaw::new(&dynamics.check_valve, rho),
            shuttle: ShuttleLaw::new(&dynamics.shuttle, rho),
            swash: parts.swash,
            motor_inertia_kg_m2: parts.motor_inertia_kg_m2,
            pump_inertia_kg_m2: pump.inertia_kg_m2,
            motor_friction: motor.friction,
            pump_friction: pump.friction,
            low_pa: machine.circuit().low_pressure_mpa * 1.0e6 + ATMOSPHERE_PA,
            pump_m3_per_rad: pump.displacement_cm3_per_rev * 1.0e-6 / std::f64::consts::TAU,
            motor_m3_per_rad: motor.displacement_cm3_per_rev * 1.0e-6 / std::f64::consts::TAU,
            oil,
        };
        let units = [(pump, parts.pump_plate, 0), (motor, parts.motor_plate, pump.pistons)];
        for (unit, plate, first) in units {
            let is_pump = first == 0;
            for i in 0..unit.pistons {
                let (g, l) = ((first + i) / WIDTH, (first + i) % WIDTH);
                let offset = std::f64::consts::TAU * i as f64 / unit.pistons as f64;
                plant.is_pump[g].0[l] = f64::from(u8::from(is_pump));
                plant.dead_m3[g].0[l] = unit.dead_volume_cm3 * 1.0e-6;
                plant.half_stroke_m3[g].0[l] = 0.5e-6 * unit.stroke_volume_cm3();
                plant.offset_rad[g].0[l] = offset;
                (plant.sin_offset[g].0[l], plant.cos_offset[g].0[l]) = offset.sin_cos();
                plant.kou_m3_s_pa[g].0[l] = kou_l_min_mpa * L_MIN_MPA;
                plant.ports[g].set_lane(l, plate, !is_pump, rho);
            }
        }
        Ok(plant)
    }

    /// Replaces the port areas of group `g` by those of the area tables, where the machine has them.
    pub(crate) fn table_areas(&self, g: usize, phi: &F64x4, a: &mut F64x4, b: &mut F64x4) {
        for l in 0..WIDTH {
            let lane = g * WIDTH + l;
            let table = if lane < self.pump_pistons { &self.pump_table } else { &self.motor_table };
            if let (Some(cells), true) = (table, lane < self.chambers()) {
                [a.0[l], b.0[l]] = look_up(cells, phi.0[l]);
            }
        }
    }

    /// C_d times area, mm2, of one chamber to line A and to line B at its own angle from top dead centre.
    #[must_use]
    pub fn cd_area_mm2(&self, lane: usize, phi_rad: f64) -> (f64, f64) {
        let (g, l) = ((lane / WIDTH).min(GROUPS - 1), lane % WIDTH);
        let phi = F64x4::all(phi_rad.rem_euclid(std::f64::consts::TAU));
        let (mut a, mut b) = self.ports[g].conductance(phi);
        self.table_areas(g, &phi, &mut a, &mut b);
        let per_mm2 = crate::valves::conductance(1.0, 1.0, self.oil.density_kg_m3());
        (a.0[l] / per_mm2, b.0[l] / per_mm2)
    }

    /// Number of chambers, pump and motor.
    #[must_use]
    pub fn chambers(&self) -> usize {
        self.pump_pistons + self.motor_pistons
    }

    /// Oil at the plant's temperature.
    #[must_use]
    pub fn oil(&self) -> &OilTable {
        &self.oil
    }
}
