//! Arguments of `simulate` and `step`: machine, operating point, step of the solver.

use std::path::PathBuf;

use kou_lumped::machine::Machine;
use kou_lumped::{LoadCondition, LumpedModel, SolverSettings, SteadyCase};

use super::failure::Failure;

/// Machine, speed, oil and leakage of one operating point.
#[derive(Debug, clap::Args)]
pub struct PointArgs {
    /// Machine file (TOML).
    #[arg(long, value_name = "MACHINE.toml")]
    pub machine: PathBuf,
    /// Pump speed, r/min.
    #[arg(long, allow_negative_numbers = true)]
    pub n_p_rpm: f64,
    /// Leakage coefficient of one chamber, (L/min)/MPa.
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    pub kou: f64,
    /// Oil temperature, degC.
    #[arg(long, default_value_t = 60.0, allow_negative_numbers = true)]
    pub t_b_c: f64,
    /// Displacement fraction of the pump, -1 to 1.
    #[arg(long, default_value_t = 1.0, allow_negative_numbers = true)]
    pub alpha: f64,
    /// Step, degrees of pump angle.
    #[arg(long, default_value_t = SolverSettings::default().step_deg, allow_negative_numbers = true)]
    pub step_deg: f64,
}

impl PointArgs {
    /// Loads the machine.
    pub(super) fn model(&self) -> Result<LumpedModel, Failure> {
        Ok(LumpedModel::new(&Machine::load(&self.machine)?)?)
    }

    /// The case with its condition at the motor.
    pub(super) fn operating(&self, condition: LoadCondition) -> SteadyCase {
        SteadyCase {
            n_p_rpm: self.n_p_rpm,
            condition,
            t_b_c: self.t_b_c,
            alpha: self.alpha,
            kou_l_min_mpa: self.kou,
        }
    }

    /// Solver settings.
    pub(super) fn settings(&self) -> SolverSettings {
        SolverSettings { step_deg: self.step_deg, ..SolverSettings::default() }
    }
}
