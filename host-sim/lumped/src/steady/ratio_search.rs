//! The search for the ratio at which the high line neither fills nor empties at the wanted mean pressure.
//!
//! Both shafts turn at imposed speeds. From one window, with mean pressure P, mean rate M' of the line's mass and mean
//! motor torque T,
//!
//! ```text
//! p_H    = P + (T_load - T)/(D_m/2 pi)         where the load is given, not the pressure
//! r      = r + M' * V_H/V_line /(mu*omega_p) + dr/dp*(p_H - P)
//! ```
//!
//! with mu the oil that the motor takes per radian, V_H the line's volume with the chambers open to it, which fill along
//! with it, and dr/dp from the start estimate; then the line is moved to p_H. A correction leaves two percent of an
//! error, so mostly one window of the members is enough; where it is not, the result is the running mean of the corrected
//! ratios, and the search ends when that mean moves by less than the tolerance.

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

/// Fraction of a correction that may be left of the error: about the largest seen over the envelope. Corrections larger than
/// the tolerance over this tell where to go, and do not enter the mean.
const LEFT: f64 = 0.02;
/// Corrections below this are not taken from the first run: the beats that it does not see are of this size.
const SCOUT_NOISE: f64 = 1.0e-3;
/// Change of the mean at which it still is a result after the last window.
const SPREAD: f64 = 1.0e-4;
/// Step of what is not measured. Its error of the ratio, 5e-5 (docs/full-model/integration.md), is far below what the run
/// that goes ahead is asked for.
const COARSE_DEG: f64 = 2.0;
/// Fraction of theory's leakage that a start estimate expects: chambers in transition leak less.
const LEAKING: f64 = 0.96;

/// A search under way.
pub struct RatioSearch<'a> {
    plant: &'a Plant,
    operating: SteadyCase,
    settings: SolverSettings,
    omega_p: f64,
    /// Line that is high, and the other.
    high: usize,
    low: usize,
    ratio: f64,
    target_pa: f64,
    ratio_per_pa: f64,
}

impl<'a> RatioSearch<'a> {
    /// Starts from the volumes alone.
    ///
    /// # Errors
    /// When compression and leakage take the pump's whole flow.
    pub fn new(
        plant: &'a Plant,
        operating: &SteadyCase,
        settings: &SolverSettings,
    ) -> Result<Self, SimError> {
        let omega_p = operating.n_p_rpm / 60.0 * TAU;
        let forward = operating.alpha > 0.0;
        let target_pa = match operating.condition {
            LoadCondition::HighPressureMpa(p) => p * 1.0e6 + ATMOSPHERE_PA,
            LoadCondition::LoadNm(load) => {
                plant.low_pa + plant.needed_torque(load, omega_p) / plant.motor_m3_per_rad
            }
        };
        let mut search = Self {
            plant,
            operating: *operating,
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
        search.demand_flow()?;
        Ok(search)
    }

    /// Ratio by the volumes alone: where the search begins; has no influence on where it ends.
    fn estimate(&self, p_pa: f64) -> f64 {
        let (plant, alpha) = (self.plant, self.operating.alpha.abs());
        let rho = (plant.oil.density_at(p_pa), plant.oil.density_at(plant.low_pa));
        let squeeze = 1.0 - rho.1 / rho.0;
        let dead = |from: usize, pistons: usize| -> f64 {
            (from..from + pistons).map(|i| plant.dead_m3[i / 4].0[i % 4]).sum::<f64>() / TAU
        };
        let (pump, motor) = (plant.pump_m3_per_rad, plant.motor_m3_per_rad);
        let pump_dead = dead(0, plant.pump_pistons) + 0.5 * (1.0 - alpha) * pump;
        let leak: f64 =
            plant.kou_m3_s_pa.iter().map(|v| v.sum()).sum::<f64>() * 0.5 * LEAKING * (p_pa - plant.case_pa);
        let flow = alpha * pump - (alpha * pump + pump_dead) * squeeze - leak / self.omega_p;
        self.operating.alpha.signum() * flow
            / (motor + dead(plant.pump_pistons, plant.motor_pistons) * squeeze)
    }

    /// Refuses a point at which nothing is left for the motor.
    fn demand_flow(&self) -> Result<(), SimError> {
        if self.ratio * self.operating.alpha.signum() > 1.0e-3 {
            return Ok(());
        }
        let wanted = match self.operating.condition {
            LoadCondition::HighPressureMpa(p) => format!("high pressure of {p} MPa"),
            LoadCondition::LoadNm(load) => format!("load of {load} N m"),
        };
        let reason = format!(
            "at {} r/min, displacement {} and Kou {} (L/min)/MPa compression and leakage take the pump's whole flow",
            self.operating.n_p_rpm, self.operating.alpha, self.operating.kou_l_min_mpa
        );
        Err(SimError::Unreachable { wanted, reason })
    }

    /// Inputs that keep the drive at the ratio found so far.
    pub fn inputs(&self) -> PlantInputs {
        PlantInputs {
            drive: ShaftDrive::SpeedRadS(self.omega_p),
            load: ShaftLoad::SpeedRadS(self.ratio * self.omega_p),
            alpha: self.operating.alpha,
        }
    }

    /// Searches; returns the point and a state on it.
    ///
    /// # Errors
    /// When the model stops, no flow is left for the motor, or the ratio does not settle.
    pub fn solve(&mut self) -> Result<(SteadyPoint, PlantState), SimError> {
        let setting = EnsembleConfig {
            plant: self.plant,
            method: self.settings.method,
            fine: StepSize::new(self.settings.step_deg, self.omega_p),
            coarse: StepSize::new(self.settings.step_deg.max(COARSE_DEG), self.omega_p),
            high: self.high,
        };
        let mut runs = Ensemble::scout(setting, &self.inputs(), self.target_pa)?;
        let start = self.ratio;
        let seen = runs.window(&self.inputs())?;
        if self.correct(&seen.means)? < SCOUT_NOISE {
            self.ratio = start;
        }
        runs.spread(self.settings.members, self.ratio, &self.inputs(), self.target_pa)?;
        let mut mean = RunningMean::default();
        let mut residual = f64::INFINITY;
        for window in 1..=MAX_WINDOWS {
            let seen = runs.window(&self.inputs())?;
            let change = self.correct(&seen.means)?;
            let left = LEFT * change;
            if left < self.settings.tolerance {
                self.ratio = mean.with(self.ratio);
                residual = if mean.count > 1 { mean.moved } else { left };
            } else {
                mean = RunningMean::default();
                residual = change;
            }
            let enough = mean.count >= self.settings.windows;
            if (enough && residual < self.settings.tolerance) || (window == MAX_WINDOWS && residual < SPREAD)
            {
                return Ok((self.point(&seen, &runs, residual), runs.into_state()));
            }
            runs.again(&self.inputs(), self.target_pa)?;
        }
        Err(SimError::NotSteady { revolutions: runs.revolutions, residual })
    }

    /// Corrects ratio and target pressure after a window; returns the change of the ratio.
    fn correct(&mut self, means: &WindowMeans) -> Result<f64, SimError> {
        let plant = self.plant;
        let mean_pa = means.p_node_pa[self.high];
        // Oil that the motor takes per radian: what it displaces, at the line's density.
        let mu = plant.motor_m3_per_rad * plant.oil.density_at(mean_pa);
        let sign = self.operating.alpha.signum();
        if let LoadCondition::LoadNm(load) = self.operating.condition {
            let lacking = plant.needed_torque(load, self.ratio * self.omega_p) - sign * means.torque_m_nm;
            self.target_pa = mean_pa + lacking / plant.motor_m3_per_rad;
        }
        let filling =
            means.node_kg_s[self.high] * high_volume_m3(plant, self.high) / plant.node_m3[self.high];
        let change = sign * filling / (mu * self.omega_p) + self.ratio_per_pa * (self.target_pa - mean_pa);
        self.ratio += change;
        self.demand_flow()?;
        Ok(change.abs())
    }

    /// The result at the wanted pressure: means of the last window, moved by the little that the window was off it.
    fn point(&self, seen: &WindowResult, runs: &Ensemble<'_>, residual: f64) -> SteadyPoint {
        let means = &seen.means;
        let gauge = |p: f64| (p - ATMOSPHERE_PA) * 1.0e-6;
        let leak_kg_s = means.flow_kg_s[PUMP_LEAKAGE] + means.flow_kg_s[MOTOR_LEAKAGE];
        let sign = self.operating.alpha.signum();
        let off_pa = self.target_pa - means.p_node_pa[self.high];
        let revolutions = runs.revolutions;
        SteadyPoint {
            ratio: self.ratio,
            residual,
            p_h_mpa: gauge(self.target_pa),
            p_l_mpa: gauge(means.p_node_pa[self.low]),
            torque_nm: sign * means.torque_m_nm + off_pa * self.plant.motor_m3_per_rad,
            pump_torque_nm: -means.torque_p_nm
                + off_pa * self.operating.alpha.abs() * self.plant.pump_m3_per_rad,
            leakage_l_min: leak_kg_s / self.plant.case_rho * 60_000.0,
            ripple_p_h_mpa: seen.ripple_pa[self.high] * 1.0e-6,
            mass_balance_error: runs.worst_balance,
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
    /// Takes one more value in; returns the mean.
    fn with(&mut self, value: f64) -> f64 {
        self.count += 1;
        let step = (value - self.value) / f64::from(self.count);
        self.moved = step.abs();
        self.value += step;
        self.value
    }
}

impl Plant {
    /// Torque that the oil must give for a load at a speed: load and friction.
    fn needed_torque(&self, load_nm: f64, omega_m: f64) -> f64 {
        load_nm + self.motor_friction.coulomb_nm + self.motor_friction.viscous_nm_s * omega_m.abs()
    }
}
