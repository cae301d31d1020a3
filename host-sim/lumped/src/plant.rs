//! A machine prepared for one oil temperature and one leakage coefficient: every constant the equations need, in SI.
//!
//! Chambers stand side by side in lanes, the pump's first, then the motor's, padded to a multiple of four with closed
//! dummy chambers, so that loops over chambers become vector instructions. Pressures inside the model are absolute.

use std::sync::{Arc, Mutex};

use crate::input::{InvalidInput, Range};
use crate::machine::{ChargeDrive, Machine, Swash};

use super::error::SimError;
use super::lanes::{V4, WIDTH};
use super::oil::{ATMOSPHERE_PA, OilTable};
use super::valve_plate::{Ports, look_up, table_of};
use super::valves::{CheckLaw, ReliefLaw, ShuttleLaw};

/// Groups of lanes for chambers: fifteen pistons on either side, padded.
pub const GROUPS: usize = 8;
/// Lanes for chambers.
pub const LANES: usize = GROUPS * WIDTH;
/// Line A, line B, charge gallery, flushing gallery.
pub const NODES: usize = 4;
/// Index of line A.
pub const A: usize = 0;
/// Index of line B.
pub const B: usize = 1;
/// Index of the charge gallery.
pub const C: usize = 2;
/// Index of the flushing gallery.
pub const F: usize = 3;
/// (L/min)/MPa in m3/s/Pa.
pub const L_MIN_MPA: f64 = 1.0 / 60_000.0 / 1.0e6;

/// Leakage coefficients for which the laminar law makes sense; beyond, a chamber would not hold pressure at all.
pub const KOU: Range = Range::new(0.0, 100.0, "(L/min)/MPa");
/// Oil temperatures kept tabulated at once; a bench has three.
const CACHED_TEMPERATURES: usize = 8;

/// The full model of one machine. Shared between threads; prepared oil tables are kept.
#[derive(Debug)]
pub struct Model {
    machine: Machine,
    oils: Mutex<Vec<(f64, Arc<OilTable>)>>,
}

impl Model {
    /// Prepares the full model of a machine.
    ///
    /// # Errors
    /// When the machine file lacks parts that the full model needs; names them.
    pub fn new(machine: &Machine) -> Result<Self, SimError> {
        machine.full()?;
        Ok(Self { machine: machine.clone(), oils: Mutex::new(Vec::new()) })
    }

    /// The machine.
    #[must_use]
    pub fn machine(&self) -> &Machine {
        &self.machine
    }

    /// The oil at a temperature.
    ///
    /// # Errors
    /// When the temperature is outside its range.
    pub fn oil(&self, t_c: f64) -> Result<Arc<OilTable>, SimError> {
        let mut oils = self.oils.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        if let Some((_, oil)) = oils.iter().find(|(t, _)| *t == t_c) {
            return Ok(Arc::clone(oil));
        }
        let oil = Arc::new(OilTable::new(self.machine.oil(), t_c)?);
        if oils.len() >= CACHED_TEMPERATURES {
            oils.remove(0);
        }
        oils.push((t_c, Arc::clone(&oil)));
        Ok(oil)
    }

    /// The plant at oil temperature `t_b_c`, every chamber of pump and motor leaking with `kou`.
    ///
    /// # Errors
    /// When temperature or coefficient are outside their ranges.
    pub fn plant(&self, t_b_c: f64, kou_l_min_mpa: f64) -> Result<Plant, SimError> {
        if !KOU.contains(kou_l_min_mpa) {
            let error = InvalidInput::new("leakage coefficient is out of range").with_value(kou_l_min_mpa);
            return Err(error.with_allowed(KOU).into());
        }
        Plant::new(&self.machine, self.oil(t_b_c)?, kou_l_min_mpa)
    }
}

/// Charge pump 3 as a mass flow.
#[derive(Debug, Clone, Copy)]
pub(super) struct Charge {
    constant_kg_s: f64,
    per_pump_rad_kg: f64,
}

impl Charge {
    /// Mass flow into the charge gallery at this speed of the main pump.
    #[inline(always)]
    pub(super) fn kg_s(&self, omega_p_rad_s: f64) -> f64 {
        self.constant_kg_s + self.per_pump_rad_kg * omega_p_rad_s.abs()
    }
}

/// One machine at one oil temperature and leakage coefficient.
#[derive(Debug, Clone)]
pub struct Plant {
    pub(super) groups: usize,
    pub(super) pump_pistons: usize,
    pub(super) motor_pistons: usize,
    /// 1 in lanes of the pump, 0 elsewhere.
    pub(super) is_pump: [V4; GROUPS],
    pub(super) dead_m3: [V4; GROUPS],
    pub(super) half_stroke_m3: [V4; GROUPS],
    pub(super) offset_rad: [V4; GROUPS],
    pub(super) cos_offset: [V4; GROUPS],
    pub(super) sin_offset: [V4; GROUPS],
    pub(super) kou_m3_s_pa: [V4; GROUPS],
    pub(super) ports: [Ports; GROUPS],
    pub(super) pump_table: Option<Vec<[f64; 2]>>,
    pub(super) motor_table: Option<Vec<[f64; 2]>>,
    pub(super) oil: Arc<OilTable>,
    pub(super) case_pa: f64,
    pub(super) case_rho: f64,
    pub(super) node_m3: [f64; NODES],
    pub(super) charge: Charge,
    pub(super) charge_relief: ReliefLaw,
    pub(super) flushing_relief: ReliefLaw,
    pub(super) high_relief: Option<ReliefLaw>,
    pub(super) check_valve: CheckLaw,
    pub(super) shuttle: ShuttleLaw,
    pub(super) swash: Swash,
    pub(super) motor_inertia_kg_m2: f64,
    pub(super) pump_inertia_kg_m2: Option<f64>,
    pub(super) motor_friction: crate::machine::Friction,
    pub(super) pump_friction: crate::machine::Friction,
    pub(super) low_pa: f64,
    pub(super) pump_m3_per_rad: f64,
    pub(super) motor_m3_per_rad: f64,
}

impl Plant {
    fn new(machine: &Machine, oil: Arc<OilTable>, kou_l_min_mpa: f64) -> Result<Self, SimError> {
        let parts = machine.full()?;
        let (pump, motor, dynamics) = (machine.pump(), parts.motor, parts.dynamics);
        let rho = oil.density_kg_m3();
        let per_rev = dynamics.charge_pump.displacement_cm3_per_rev * 1.0e-6 * rho;
        let charge = match dynamics.charge_pump.drive {
            ChargeDrive::OwnSpeedRpm(rpm) => {
                Charge { constant_kg_s: per_rev * rpm / 60.0, per_pump_rad_kg: 0.0 }
            }
            ChargeDrive::PumpShaftRatio(ratio) => {
                Charge { constant_kg_s: 0.0, per_pump_rad_kg: per_rev * ratio / std::f64::consts::TAU }
            }
        };
        let chambers = pump.pistons + motor.pistons;
        let case_pa = machine.circuit().case_pressure_mpa * 1.0e6 + ATMOSPHERE_PA;
        let mut plant = Self {
            groups: chambers.div_ceil(WIDTH).min(GROUPS),
            pump_pistons: pump.pistons,
            motor_pistons: motor.pistons,
            is_pump: [V4::ZERO; GROUPS],
            // Padding lanes are closed chambers of 10 cm3 that never move.
            dead_m3: [V4::all(1.0e-5); GROUPS],
            half_stroke_m3: [V4::ZERO; GROUPS],
            offset_rad: [V4::ZERO; GROUPS],
            cos_offset: [V4::all(1.0); GROUPS],
            sin_offset: [V4::ZERO; GROUPS],
            kou_m3_s_pa: [V4::ZERO; GROUPS],
            ports: [Ports::default(); GROUPS],
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

    /// Replaces the areas of group `g` by those of the units' tables, where they have them.
    pub(super) fn table_areas(&self, g: usize, phi: &V4, a: &mut V4, b: &mut V4) {
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
        let phi = V4::all(phi_rad.rem_euclid(std::f64::consts::TAU));
        let (mut a, mut b) = self.ports[g].conductance(phi);
        self.table_areas(g, &phi, &mut a, &mut b);
        let per_mm2 = super::valves::conductance(1.0, 1.0, self.oil.density_kg_m3());
        (a.0[l] / per_mm2, b.0[l] / per_mm2)
    }

    /// Number of chambers, pump and motor.
    #[must_use]
    pub fn chambers(&self) -> usize {
        self.pump_pistons + self.motor_pistons
    }

    /// The oil.
    #[must_use]
    pub fn oil(&self) -> &OilTable {
        &self.oil
    }
}
