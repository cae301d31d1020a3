//! `host-sim replay`: a log through the estimator on this computer.

use std::path::PathBuf;
use std::time::Instant;

use kou_estimator::{Params, State, step};
use serde::Serialize;

use super::given::mapping;
use super::{Failure, print_json, print_text, progress};
use crate::replay::{EstimateWriter, Figures, HealthFigures, HealthSummary, Summary, Trace, draw};
use kou_identify::calibration;
use kou_records::LogReader;

/// Replays a log through the estimator.
#[derive(Debug, clap::Args)]
#[group(id = "replay")]
pub struct Args {
    /// Log (CSV): time_s, n_p_rpm, n_m_rpm (or flow_l_min), p_h_mpa, t_b_c and optionally p_l_mpa, alpha.
    #[arg(long, value_name = "LOG.csv")]
    pub log: PathBuf,
    /// Calibration: TOML or binary record.
    #[arg(long, value_name = "CAL.toml")]
    pub calibration: PathBuf,
    /// Mapping file (TOML) for a log with other columns or units.
    #[arg(long, value_name = "MAP.toml")]
    pub map: Option<PathBuf>,
    /// Estimates to write (CSV).
    #[arg(long, value_name = "EST.csv")]
    pub out: Option<PathBuf>,
    /// Picture to draw (SVG): measured and expected ratio, Kou seen and by the law.
    #[arg(long, value_name = "PICTURE.svg")]
    pub plot: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

#[derive(Serialize)]
struct Report {
    #[serde(flatten)]
    figures: Figures,
    health: HealthFigures,
    rows_passed_over: u64,
    samples_per_s: f64,
}

/// Runs the command.
///
/// # Errors
/// Bad input, or an output that cannot be written.
pub fn run(args: &Args) -> Result<(), Failure> {
    let (_, params) = calibration::read_checked(&args.calibration)?;
    let report = replay(args, &params)?;
    if args.json { print_json(&report) } else { print_text(&text(&report)) }
}

fn replay(args: &Args, params: &Params) -> Result<Report, Failure> {
    let mut log = LogReader::open(&args.log, &mapping(args.map.as_deref())?)?;
    let mut writer =
        args.out.as_deref().map(|path| EstimateWriter::create(path, &log.carried_names())).transpose()?;
    let (mut summary, mut trace, mut state) = (Summary::default(), Trace::default(), State::new());
    let mut health = HealthSummary::default();
    let bar = progress("replay");
    let started = Instant::now();
    for row in &mut log {
        let row = row?;
        let estimate = step(params, &mut state, &row.sample);
        summary.add(&estimate);
        health.add(&estimate);
        if args.plot.is_some() {
            trace.add(row.time_s, &estimate);
        }
        if let Some(writer) = &mut writer {
            writer.write(&row, &estimate)?;
        }
        bar.inc(1);
    }
    let elapsed_s = started.elapsed().as_secs_f64();
    bar.finish_and_clear();
    if let Some(writer) = writer {
        writer.finish()?;
    }
    let figures = summary.figures();
    if let Some(path) = &args.plot {
        draw(path, &format!("Replay of {}", args.log.display()), &trace)?;
    }
    let samples_per_s = figures.samples as f64 / elapsed_s;
    let health = health.figures(params, &state);
    Ok(Report { figures, health, rows_passed_over: log.passed_over(), samples_per_s })
}

/// Figures for people.
pub(super) fn figures_text(figures: &Figures) -> String {
    let mut text = format!("{} samples, {} accepted", figures.samples, figures.accepted);
    for (reason, count) in &figures.rejected {
        text += &format!("\n  {count:>8} not judged: {reason}");
    }
    if let (Some(mean), Some(max), Some(kou), Some(wear)) =
        (figures.ratio_error_mean, figures.ratio_error_max, figures.kou_mean, figures.wear_ratio_mean)
    {
        text += &format!("\nratio expected - measured: mean {mean:.5}, largest {max:.5}");
        text += &format!("\nKou seen: mean {kou:.4} (L/min)/MPa per chamber; {wear:.3} times the law");
    }
    text
}

fn text(report: &Report) -> String {
    format!(
        "{}\n{}\n{:.0} samples per second",
        figures_text(&report.figures),
        report.health.text(),
        report.samples_per_s
    )
}
