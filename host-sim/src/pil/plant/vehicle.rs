//! Vehicle: pump, motor and circuit, by the lumped model or by a surrogate.
//!
//! Its leakage is that of the synthetic bench records, three gaps and no quadratic, times the scenario's wear, updated every
//! 20 ms with the present operating point.

use std::f64::consts::TAU;

use kou_estimator::model::flow_balance::OperatingPoint;
use kou_estimator::units::{Celsius, LeakageCoefficient, Megapascal, Ratio, RevPerMin};
use kou_estimator::{Calibration, Params};

use super::error::LoopError;
use super::scenario::{DriverCommand, Scenario, VehicleModel};
use crate::synth::kou_truth;
use kou_lumped::integrator::Integrator;
use kou_lumped::layout::{LINE_A, LINE_B};
use kou_lumped::machine::Machine;
use kou_lumped::oil::ATMOSPHERE_PA;
use kou_lumped::plant_state::{PlantInputs, PlantState};

use kou_lumped::shaft::{ShaftDrive, ShaftLoad};
use kou_lumped::stepping::{StepObserver, advance};
use kou_lumped::tableau::Method;
use kou_lumped::{LumpedModel, Plant};
use kou_records::InputError;

/// Milliseconds between two updates of the true leakage.
const TRUTH_MS: u64 = 20;
/// Largest step, as pump angle and as time.
const STEP_RAD: f64 = 0.75 / 360.0 * TAU;
const STEP_S: f64 = 1.0e-4;
/// Lower limits of speed and pressure in the true leakage, so that the law of gaps holds: a machine that turns under load.
const LEAST_RPM: f64 = 100.0;
const LEAST_MPA: f64 = 1.0;
/// Time constant of the surrogate's motor, s.
const LAG_S: f64 = 0.05;

/// True state of the vehicle at the end of a millisecond.
#[derive(Debug, Clone, PartialEq)]
pub struct VehicleTruth {
    /// Pump speed, r/min.
    pub n_p_rpm: f64,
    /// Motor speed, r/min.
    pub n_m_rpm: f64,
    /// Gauge pressures of lines A and B, MPa.
    pub lines_mpa: [f64; 2],
    /// Displacement.
    pub alpha: f64,
    /// Oil temperature, degC.
    pub t_b_c: f64,
    /// Leakage coefficient of each chamber, (L/min)/MPa.
    pub kou: f64,
    /// Leakage coefficient without the scenario's wear, which the law should give.
    pub kou_unworn: f64,
    /// Shaft angles during the millisecond: time within it in s, pump and motor in turns.
    pub turns: Vec<[f64; 3]>,
}

/// A vehicle.
// One of them exists at a time.
#[allow(clippy::large_enum_variant, reason = "there is one vehicle in a run")]
pub enum Vehicle {
    /// Simulated by the lumped model.
    Full(LumpedVehicle),
    /// Simulated by the calibration's reduced model.
    Surrogate(SurrogateVehicle),
}

impl Vehicle {
    /// The vehicle of a scenario, at rest.
    ///
    /// # Errors
    /// A machine without the parts that its model needs.
    pub fn new(machine: &Machine, calibration: &Calibration, scenario: &Scenario) -> Result<Self, LoopError> {
        let first = scenario.command(0.0);
        Ok(match scenario.vehicle {
            VehicleModel::Full => Self::Full(LumpedVehicle::new(machine, &first)?),
            VehicleModel::Surrogate => Self::Surrogate(SurrogateVehicle::new(machine, calibration)?),
        })
    }

    /// Advances by one millisecond.
    ///
    /// # Errors
    /// When the model fails.
    pub fn millisecond(&mut self, command: &DriverCommand) -> Result<VehicleTruth, LoopError> {
        match self {
            Self::Full(full) => full.millisecond(command),
            Self::Surrogate(surrogate) => Ok(surrogate.millisecond(command)),
        }
    }
}

fn truth_at(machine: &Machine, command: &DriverCommand, p_h_mpa: f64) -> f64 {
    command.wear * kou_truth(machine, command.n_p_rpm.max(LEAST_RPM), p_h_mpa.max(LEAST_MPA), command.t_b_c)
}

/// Vehicle of the lumped model.
pub struct LumpedVehicle {
    machine: Machine,
    model: LumpedModel,
    plant: Plant,
    state: PlantState,
    kou: f64,
    high_mpa: f64,
    ms: u64,
}

struct AngleRecorder<'a> {
    begin_s: f64,
    into: &'a mut Vec<[f64; 3]>,
}

impl StepObserver for AngleRecorder<'_> {
    fn observe(&mut self, state: &PlantState, _: f64) {
        self.into.push([state.time_s - self.begin_s, state.phi_p_rad / TAU, state.phi_m_rad / TAU]);
    }
}

fn inputs(command: &DriverCommand) -> PlantInputs {
    PlantInputs {
        drive: ShaftDrive::SpeedRadS(command.n_p_rpm / 60.0 * TAU),
        load: ShaftLoad::ResistiveNm(command.load_nm),
        alpha: command.alpha,
    }
}

impl LumpedVehicle {
    fn new(machine: &Machine, first: &DriverCommand) -> Result<Self, LoopError> {
        let model = LumpedModel::new(machine)?;
        let kou = truth_at(machine, first, 0.0);
        let plant = model.plant(first.t_b_c.round(), kou)?;
        let low_pa = machine.circuit().low_pressure_mpa * 1.0e6 + ATMOSPHERE_PA;
        let state =
            Integrator::new(&plant, Method::TrBdf2).initial(low_pa, low_pa, &inputs(first), first.alpha, 0.0);
        Ok(Self { machine: machine.clone(), model, plant, state, kou, high_mpa: 0.0, ms: 0 })
    }

    fn millisecond(&mut self, command: &DriverCommand) -> Result<VehicleTruth, LoopError> {
        if self.ms.is_multiple_of(TRUTH_MS) {
            self.kou = truth_at(&self.machine, command, self.high_mpa);
            // Full degrees: the oil's tables are cached, and none of its properties but viscosity changes much in one.
            self.plant = self.model.plant(command.t_b_c.round(), self.kou)?;
            self.state.restart();
        }
        self.ms += 1;
        let inputs = inputs(command);
        let omega = command.n_p_rpm / 60.0 * TAU;
        let steps = (1e-3 * omega / STEP_RAD).max(1e-3 / STEP_S).ceil();
        let mut turns = vec![[0.0, self.state.phi_p_rad / TAU, self.state.phi_m_rad / TAU]];
        let mut angles = AngleRecorder { begin_s: self.state.time_s, into: &mut turns };
        let mut integrator = Integrator::new(&self.plant, Method::TrBdf2);
        advance(&mut integrator, &mut self.state, &inputs, 1e-3 / steps, steps as u64, &mut angles)?;
        let gauge = |line: usize| (self.state.p_node_pa[line] - ATMOSPHERE_PA) * 1.0e-6;
        let lines_mpa = [gauge(LINE_A), gauge(LINE_B)];
        // Mean over some periods of the ripple, on which the leakage depends.
        self.high_mpa += 0.02 * (lines_mpa[0].max(lines_mpa[1]) - self.high_mpa);
        Ok(VehicleTruth {
            n_p_rpm: command.n_p_rpm,
            n_m_rpm: self.state.omega_m_rad_s / TAU * 60.0,
            lines_mpa,
            alpha: self.state.alpha,
            t_b_c: command.t_b_c,
            kou: self.kou,
            kou_unworn: self.kou / command.wear,
            turns,
        })
    }
}

/// Vehicle of the reduced model, with a first-order lag of the motor.
pub struct SurrogateVehicle {
    machine: Machine,
    params: Params,
    low_mpa: f64,
    m3_per_rad: f64,
    n_m_rpm: f64,
    pump_turns: f64,
    motor_turns: f64,
}

impl SurrogateVehicle {
    fn new(machine: &Machine, calibration: &Calibration) -> Result<Self, InputError> {
        let params =
            Params::new(calibration).map_err(|e| InputError::new(format!("calibration rejected: {e}")))?;
        let motor = machine.motor().map_or(0.0, |motor| motor.displacement_cm3_per_rev);
        if motor <= 0.0 {
            return Err(InputError::new("a closed loop needs a machine with a motor"));
        }
        let low_mpa = f64::from(params.low_pressure().get());
        Ok(Self {
            machine: machine.clone(),
            params,
            low_mpa,
            m3_per_rad: motor * 1.0e-6 / TAU,
            n_m_rpm: 0.0,
            pump_turns: 0.0,
            motor_turns: 0.0,
        })
    }

    #[allow(clippy::cast_possible_truncation, reason = "the estimator works in f32")]
    fn millisecond(&mut self, command: &DriverCommand) -> VehicleTruth {
        let driving = command.alpha.abs() > 0.02 && command.n_p_rpm > LEAST_RPM;
        let rise_mpa = if driving { command.load_nm / self.m3_per_rad * 1.0e-6 } else { 0.0 };
        let high_mpa = self.low_mpa + rise_mpa;
        let kou = truth_at(&self.machine, command, high_mpa);
        let ratio = if driving {
            let at = OperatingPoint {
                pump_speed: RevPerMin(command.n_p_rpm as f32),
                high_pressure: Megapascal(high_mpa as f32),
                low_pressure: Megapascal(self.low_mpa as f32),
                oil_temperature: Celsius(command.t_b_c as f32),
                displacement: Ratio(command.alpha as f32),
            };
            f64::from(self.params.reduced().balance(&at).ratio(LeakageCoefficient(kou as f32)).get())
        } else {
            0.0
        };
        self.n_m_rpm += (command.n_p_rpm * ratio - self.n_m_rpm) * 1e-3 / LAG_S;
        let before = [0.0, self.pump_turns, self.motor_turns];
        self.pump_turns += command.n_p_rpm / 60.0 * 1e-3;
        self.motor_turns += self.n_m_rpm / 60.0 * 1e-3;
        let high_is_a = command.alpha >= 0.0;
        VehicleTruth {
            n_p_rpm: command.n_p_rpm,
            n_m_rpm: self.n_m_rpm,
            lines_mpa: if high_is_a { [high_mpa, self.low_mpa] } else { [self.low_mpa, high_mpa] },
            alpha: command.alpha,
            t_b_c: command.t_b_c,
            kou,
            kou_unworn: kou / command.wear,
            turns: vec![before, [1e-3, self.pump_turns, self.motor_turns]],
        }
    }
}
