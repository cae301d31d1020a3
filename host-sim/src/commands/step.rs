//! `host-sim step`: response of the motor's speed to a swash step (paper fig. 7).

use std::path::PathBuf;
use std::time::Instant;

use serde::Serialize;

use super::lines::{Lines, Series};
use super::point::Point;
use super::{Failure, print_json, print_text};
use kou_lumped::LoadCondition;
use kou_lumped::transient::swash_step;

/// Simulates the swash plate's step to a displacement, the motor starting from rest against a resistive load.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Operating point after the step.
    #[command(flatten)]
    pub point: Point,
    /// Load on the motor's shaft, N m.
    #[arg(long, allow_negative_numbers = true)]
    pub load_nm: f64,
    /// Simulated time, s.
    #[arg(long, default_value_t = 2.0, allow_negative_numbers = true)]
    pub duration_s: f64,
    /// Response to write (CSV): time, motor speed, line pressures.
    #[arg(long, value_name = "FILE.csv")]
    pub out: Option<PathBuf>,
    /// Picture to draw (SVG).
    #[arg(long, value_name = "PICTURE.svg")]
    pub plot: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

#[derive(Serialize)]
struct Report {
    n_m_steady_rpm: f64,
    overshoot_pct: f64,
    settling_s: f64,
    oscillation_hz: Option<f64>,
    mass_balance_error: f64,
    sim_seconds: f64,
    wall_seconds: f64,
}

/// Runs the command.
///
/// # Errors
/// Bad input, a load that cannot be turned, or a response that does not settle in time.
pub fn run(args: &Args) -> Result<(), Failure> {
    let model = args.point.model()?;
    let operating = args.point.operating(LoadCondition::LoadNm(args.load_nm));
    let started = Instant::now();
    let response = swash_step(&model, &operating, &args.point.settings(), args.duration_s)?;
    let wall_seconds = started.elapsed().as_secs_f64();
    let picture = Lines {
        title: "Response to a swash step",
        x: "time_s",
        y: "n_m_rpm",
        series: vec![Series::new("motor speed", response.trace.iter().map(|row| (row[0], row[1])))],
    };
    if let Some(path) = &args.out {
        picture.write_csv(path)?;
    }
    if let Some(path) = &args.plot {
        picture.draw(path)?;
    }
    let report = Report {
        n_m_steady_rpm: response.n_m_steady_rpm,
        overshoot_pct: response.overshoot_pct,
        settling_s: response.settling_s,
        oscillation_hz: response.oscillation_hz,
        mass_balance_error: response.mass_balance_error,
        sim_seconds: response.sim_seconds,
        wall_seconds,
    };
    if args.json {
        return print_json(&report);
    }
    let oscillation = report.oscillation_hz.map_or("none".into(), |f| format!("{f:.2} Hz"));
    print_text(&format!(
        "steady motor speed {:.2} r/min\novershoot          {:.2} %\nsettling (2 %)     {:.4} s\n\
         oscillation        {oscillation}",
        report.n_m_steady_rpm, report.overshoot_pct, report.settling_s
    ))
}
