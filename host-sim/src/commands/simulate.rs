//! `host-sim simulate`: one steady operating point of the lumped model.

use std::path::PathBuf;
use std::time::Instant;

use serde::Serialize;

use super::failure::Failure;
use super::output::{print_json, print_text};
use super::point_args::PointArgs;
use kou_lumped::integrator::Integrator;
use kou_lumped::stepping::advance;
use kou_lumped::waveforms::WaveformRecorder;
use kou_lumped::{LoadCondition, SolverSettings, SteadyPoint};

/// Step of recorded waveforms: chamber pressures are then within 0.2 % of their peak to peak (see
/// docs/full-model/integration.md).
const WAVEFORM_STEP_DEG: f64 = 0.1;

/// Solves one steady operating point of the lumped model at a given high pressure or load.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Operating point.
    #[command(flatten)]
    pub point: PointArgs,
    /// High pressure, held as on a bench, MPa gauge.
    #[arg(
        long,
        required_unless_present = "load_nm",
        conflicts_with = "load_nm",
        allow_negative_numbers = true
    )]
    pub p_h_mpa: Option<f64>,
    /// Load on the motor's shaft, N m; the high pressure follows.
    #[arg(long, allow_negative_numbers = true)]
    pub load_nm: Option<f64>,
    /// Waveforms to write (CSV): angles, chamber and line pressures, flows, torques, motor speed.
    #[arg(long, value_name = "FILE.csv")]
    pub waveforms: Option<PathBuf>,
    /// Pump revolutions of the waveforms.
    #[arg(long, default_value_t = 2.0)]
    pub revolutions: f64,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

#[derive(Serialize)]
struct SteadyReport {
    ratio: f64,
    residual: f64,
    n_m_rpm: f64,
    p_h_mpa: f64,
    p_l_mpa: f64,
    torque_nm: f64,
    pump_torque_nm: f64,
    leakage_l_min: f64,
    ripple_p_h_mpa: f64,
    mass_balance_error: f64,
    sim_seconds: f64,
    wall_seconds: f64,
}

/// Runs the command.
///
/// # Errors
/// Bad input, a point that does not exist, or no convergence.
pub fn run(args: &Args) -> Result<(), Failure> {
    let condition = match (args.p_h_mpa, args.load_nm) {
        (Some(p), _) => LoadCondition::HighPressureMpa(p),
        (None, Some(load)) => LoadCondition::LoadNm(load),
        (None, None) => {
            return Err(kou_records::InputError::new("give --p-h-mpa or --load-nm").into());
        }
    };
    let model = args.point.model()?;
    let operating = args.point.operating(condition);
    let started = Instant::now();
    let point = SteadyPoint::solve_with(&model, &operating, &args.point.settings())?;
    let wall_seconds = started.elapsed().as_secs_f64();
    if let Some(path) = &args.waveforms {
        write_waveforms(args, &model, &operating, path)?;
    }
    let report = SteadyReport {
        ratio: point.ratio,
        residual: point.residual,
        n_m_rpm: point.ratio * args.point.n_p_rpm,
        p_h_mpa: point.p_h_mpa,
        p_l_mpa: point.p_l_mpa,
        torque_nm: point.torque_nm,
        pump_torque_nm: point.pump_torque_nm,
        leakage_l_min: point.leakage_l_min,
        ripple_p_h_mpa: point.ripple_p_h_mpa,
        mass_balance_error: point.mass_balance_error,
        sim_seconds: point.sim_seconds,
        wall_seconds,
    };
    if args.json { print_json(&report) } else { print_text(&text(&report)) }
}

fn write_waveforms(
    args: &Args,
    model: &kou_lumped::LumpedModel,
    operating: &kou_lumped::SteadyCase,
    path: &std::path::Path,
) -> Result<(), Failure> {
    let turns = kou_records::AllowedRange::new(0.01, 200.0, "revolutions");
    if !turns.contains(args.revolutions) {
        let error = kou_records::InputError::new("length of the waveforms is out of range");
        return Err(error.with_value(args.revolutions).with_allowed(turns).into());
    }
    let settings =
        SolverSettings { step_deg: args.point.step_deg.min(WAVEFORM_STEP_DEG), ..SolverSettings::default() };
    let plant = model.plant(operating.t_b_c, operating.kou_l_min_mpa)?;
    let (_, mut state, inputs) = SteadyPoint::solve_state(&plant, model, operating, &settings)?;
    state.time_s = 0.0;
    let mut integrator = Integrator::new(&plant, settings.method);
    state.restart();
    let mut recorder = WaveformRecorder::new(&plant, 1);
    let h = settings.step_deg / 6.0 / operating.n_p_rpm;
    let steps = (args.revolutions * 360.0 / settings.step_deg).ceil() as u64;
    advance(&mut integrator, &mut state, &inputs, h, steps, &mut recorder)?;
    Ok(recorder.write_csv(path)?)
}

fn text(report: &SteadyReport) -> String {
    format!(
        "speed ratio        {:.6} (residual {:.0e}), motor {:.2} r/min\n\
         pressures          high {:.3} MPa (ripple {:.3} MPa peak to peak), low {:.3} MPa\n\
         torque             motor {:.1} N m, pump {:.1} N m\n\
         leakage            {:.3} L/min\n\
         mass balance error {:.1e} of the pumped mass\n\
         simulated          {:.3} s in {:.3} s",
        report.ratio,
        report.residual,
        report.n_m_rpm,
        report.p_h_mpa,
        report.ripple_p_h_mpa,
        report.p_l_mpa,
        report.torque_nm,
        report.pump_torque_nm,
        report.leakage_l_min,
        report.mass_balance_error,
        report.sim_seconds,
        report.wall_seconds
    )
}
