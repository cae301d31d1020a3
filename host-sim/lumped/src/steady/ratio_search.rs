//! Search for the speed ratio at which the high line neither fills nor empties at the wanted mean pressure.
//!
//! Both shafts turn at imposed speeds. From one window, with mean pressure P, mean rate M' of the line's mass and mean
//! motor torque T,
//!
//! ```text
//! p_H    = P + (T_load - T)/(D_m/2 pi)         where the load is given, not the pressure
//! r      = r + M' * V_H/V_line /(mu*omega_p) + dr/dp*(p_H - P)
//! ```
//!
//! with mu the oil that the motor displaces per radian, V_H the volume of the line and the chambers open to it, which
//! fill along with it, and dr/dp from the start estimate; then the line is set to p_H. A correction reduces an error to
//! two percent, so mostly one window of the members suffices; where it does not, the result is the running mean of the
//! corrected ratios, and the search ends when that mean changes by less than the tolerance.

use std::f64::consts::TAU;

use crate::averaging::WindowMeans;
use crate::error::SimError;
use crate::hydraulics::{MOTOR_LEAKAGE, PUMP_LEAKAGE};
use crate::layout::{LINE_A, LINE_B};
use crate::oil::ATMOSPHERE_PA;
use crate::plant::Plant;
use crate::plant_state::{PlantInputs, PlantState};
use crate::shaft::{ShaftDrive, ShaftLoad};

use super::case::{LoadCondition, SteadyCase};
use super::ensemble::{Ensemble, EnsembleConfig, StepSize, WindowResult, high_volume_m3};
use super::point::SteadyPoint;
use super::settings::{MAX_WINDOWS, SolverSettings};

/// Fraction of an error that a correction leaves: about the largest observed over the envelope. Corrections larger than
/// the tolerance over this fraction do not enter the mean.
const CORRECTION_RESIDUAL: f64 = 0.02;
/// Corrections below this are not applied from the scout run: its unresolved beats are of this size.
const SCOUT_NOISE: f64 = 1.0e-3;
/// Largest change of the mean with which the last window still yields a result.
const FINAL_TOL: f64 = 1.0e-4;
/// Step of the scout run and of transients. Its error of the ratio, 5e-5 (docs/full-model/integration.md), is far below
/// the scout's tolerance.
const COARSE_DEG: f64 = 2.0;
/// Fraction of the theoretical leakage in the start estimate: chambers in transition leak less.
const LEAKAGE_FRACTION: f64 = 0.96;

/// State of the search.
pub struct RatioSearch<'a> {
    plant: &'a Plant,
    case: SteadyCase,
    settings: SolverSettings,
    omega_p: f64,
    /// High line and low line.
    high: usize,
    low: usize,
    ratio: f64,
    target_pa: f64,
    ratio_per_pa: f64,
}

impl<'a> RatioSearch<'a> {
    /// Search with a start estimate from the volumes alone.
    ///
    /// # Errors
    /// When compression and leakage consume the pump's whole flow.
    pub fn new(plant: &'a Plant, case: &SteadyCase, settings: &SolverSettings) -> Result<Self, SimError> {
        let omega_p = case.n_p_rpm / 60.0 * TAU;
        let forward = case.alpha > 0.0;
        let target_pa = match case.condition {
            LoadCondition::HighPressureMpa(p) => p * 1.0e6 + ATMOSPHERE_PA,
            LoadCondition::LoadNm(load) => {
                plant.low_pa + plant.needed_torque(load, omega_p) / plant.motor_m3_per_rad
            }
        };
        let mut search = Self {
            plant,
            case: *case,
            settings: *settings,
            omega_p,
            high: if forward { LINE_A } else { LINE_B },
            low: if forward { LINE_B } else { LINE_A },
            ratio: 0.0,
            target_pa,
            ratio_per_pa: 0.0,
        };
        search.ratio = search.estimate(target_pa);
        search.ratio_per_pa =
            (search.estimate(target_pa + 1.0e5) - search.estimate(target_pa - 1.0e5)) / 2.0e5;
        search.check_motor_flow()?;
        Ok(search)
    }

    /// Start estimate of the ratio from the volumes alone; no influence on the result.
    fn estimate(&self, p_pa: f64) -> f64 {
        let (plant, alpha) = (self.plant, self.case.alpha.abs());
        let rho = (plant.oil.density_at(p_pa), plant.oil.density_at(plant.low_pa));
        let squeeze = 1.0 - rho.1 / rho.0;
        let dead = |from: usize, pistons: usize| -> f64 {
            (from..from + pistons).map(|i| plant.dead_m3[i / 4].0[i % 4]).sum::<f64>() / TAU
        };
        let (pump, motor) = (plant.pump_m3_per_rad, plant.motor_m3_per_rad);
        let pump_dead = dead(0, plant.pump_pistons) + 0.5 * (1.0 - alpha) * pump;
        let leak: f64 = plant.kou_m3_s_pa.iter().map(|v| v.sum()).sum::<f64>()
            * 0.5
            * LEAKAGE_FRACTION
            * (p_pa - plant.case_pa);
        let flow = alpha * pump - (alpha * pump + pump_dead) * squeeze - leak / self.omega_p;
        self.case.alpha.signum() * flow / (motor + dead(plant.pump_pistons, plant.motor_pistons) * squeeze)
    }

    /// Rejects a case in which no flow remains for the motor.
    fn check_motor_flow(&self) -> Result<(), SimError> {
        if self.ratio * self.case.alpha.signum() > 1.0e-3 {
            return Ok(());
        }
        let wanted = match self.case.condition {
            LoadCondition::HighPressureMpa(p) => format!("high pressure of {p} MPa"),
            LoadCondition::LoadNm(load) => format!("load of {load} N m"),
        };
        let reason = format!(
            "at {} r/min, displacement {} and Kou {} (L/min)/MPa compression and leakage consume the pump's whole flow",
            self.case.n_p_rpm, self.case.alpha, self.case.kou_l_min_mpa
        );
        Err(SimError::Unreachable { wanted, reason })
    }

    /// Inputs that hold the drive at the current ratio.
    pub fn inputs(&self) -> PlantInputs {
        PlantInputs {
            drive: ShaftDrive::SpeedRadS(self.omega_p),
            load: ShaftLoad::SpeedRadS(self.ratio * self.omega_p),
            alpha: self.case.alpha,
        }
    }

    /// Runs the search; returns the steady point and a state on it.
    ///
    /// # Errors
    /// When a step fails, no flow remains for the motor, or the ratio does not converge.
    pub fn solve(&mut self) -> Result<(SteadyPoint, PlantState), SimError> {
        let config = EnsembleConfig {
            plant: self.plant,
            method: self.settings.method,
            fine: StepSize::new(self.settings.step_deg, self.omega_p),
            coarse: StepSize::new(self.settings.step_deg.max(COARSE_DEG), self.omega_p),
            high: self.high,
        };
        let mut ensemble = Ensemble::scout(config, &self.inputs(), self.target_pa)?;
        let start = self.ratio;
        let result = ensemble.window(&self.inputs())?;
        if self.correct(&result.means)? < SCOUT_NOISE {
            self.ratio = start;
        }
        ensemble.start_members(self.settings.members, self.ratio, &self.inputs(), self.target_pa)?;
        let mut mean = RunningMean::default();
        let mut residual = f64::INFINITY;
        for window in 1..=MAX_WINDOWS {
            let result = ensemble.window(&self.inputs())?;
            let change = self.correct(&result.means)?;
            let left = CORRECTION_RESIDUAL * change;
            if left < self.settings.tolerance {
                self.ratio = mean.push(self.ratio);
                residual = if mean.count > 1 { mean.moved } else { left };
            } else {
                mean = RunningMean::default();
                residual = change;
            }
            let enough = mean.count >= self.settings.windows;
            if (enough && residual < self.settings.tolerance)
                || (window == MAX_WINDOWS && residual < FINAL_TOL)
            {
                return Ok((self.point(&result, &ensemble, residual), ensemble.into_state()));
            }
            ensemble.prepare_window(&self.inputs(), self.target_pa)?;
        }
        Err(SimError::NotSteady { revolutions: ensemble.revolutions, residual })
    }

    /// Corrects ratio and target pressure after a window; returns the change of the ratio.
    fn correct(&mut self, means: &WindowMeans) -> Result<f64, SimError> {
        let plant = self.plant;
        let mean_pa = means.p_node_pa[self.high];
        // Mass that the motor displaces per radian, at the line's density.
        let mu = plant.motor_m3_per_rad * plant.oil.density_at(mean_pa);
        let sign = self.case.alpha.signum();
        if let LoadCondition::LoadNm(load) = self.case.condition {
            let torque_residual =
                plant.needed_torque(load, self.ratio * self.omega_p) - sign * means.torque_m_nm;
            self.target_pa = mean_pa + torque_residual / plant.motor_m3_per_rad;
        }
        let filling =
            means.node_kg_s[self.high] * high_volume_m3(plant, self.high) / plant.node_m3[self.high];
        let change = sign * filling / (mu * self.omega_p) + self.ratio_per_pa * (self.target_pa - mean_pa);
        self.ratio += change;
        self.check_motor_flow()?;
        Ok(change.abs())
    }

    /// Result at the wanted pressure: means of the last window, corrected for its small deviation in pressure.
    fn point(&self, result: &WindowResult, ensemble: &Ensemble<'_>, residual: f64) -> SteadyPoint {
        let means = &result.means;
        let gauge = |p: f64| (p - ATMOSPHERE_PA) * 1.0e-6;
        let leak_kg_s = means.flow_kg_s[PUMP_LEAKAGE] + means.flow_kg_s[MOTOR_LEAKAGE];
        let sign = self.case.alpha.signum();
        let off_pa = self.target_pa - means.p_node_pa[self.high];
        let revolutions = ensemble.revolutions;
        SteadyPoint {
            ratio: self.ratio,
            residual,
            p_h_mpa: gauge(self.target_pa),
            p_l_mpa: gauge(means.p_node_pa[self.low]),
            torque_nm: sign * means.torque_m_nm + off_pa * self.plant.motor_m3_per_rad,
            pump_torque_nm: -means.torque_p_nm + off_pa * self.case.alpha.abs() * self.plant.pump_m3_per_rad,
            leakage_l_min: leak_kg_s / self.plant.case_rho * 60_000.0,
            ripple_p_h_mpa: result.ripple_pa[self.high] * 1.0e-6,
            mass_balance_error: ensemble.worst_balance,
            sim_seconds: revolutions * TAU / self.omega_p,
            revolutions,
        }
    }
}

/// Running mean of the corrected ratios.
#[derive(Debug, Default)]
struct RunningMean {
    count: u32,
    value: f64,
    moved: f64,
}

impl RunningMean {
    /// Adds a value; returns the mean.
    fn push(&mut self, value: f64) -> f64 {
        self.count += 1;
        let step = (value - self.value) / f64::from(self.count);
        self.moved = step.abs();
        self.value += step;
        self.value
    }
}

impl Plant {
    /// Torque that the oil must exert for a load at a speed: load and friction.
    fn needed_torque(&self, load_nm: f64, omega_m: f64) -> f64 {
        load_nm + self.motor_friction.coulomb_nm + self.motor_friction.viscous_nm_s * omega_m.abs()
    }
}
