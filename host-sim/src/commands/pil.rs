//! `host-sim pil`: processor in the loop.
//!
//! The samples of a log through the firmware in QEMU, every field of every estimate compared with the host's, bit for bit;
//! or, with `--plant`, the controller's firmware in a closed loop with a simulated vehicle.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::path::{Path, PathBuf};

use kou_estimator::record;
use kou_estimator::{Calibration, Estimate, Params, Sample, State, step};
use serde::Serialize;

use super::bench_args::mapping;
use super::failure::Failure;
use super::output::{print_json, print_text, progress};
use super::replay::figures_text;
use crate::pil::plant::{self, LoopReport, Scenario};
use crate::pil::{self, PilOptions, PilReport, same_bits};
use crate::replay::{EstimateTrace, EstimateWriter, Figures, HealthFigures, HealthSummary, Summary};
use kou_lumped::machine::Machine;
use kou_records::InputError;
use kou_records::calibration;
use kou_records::{LogReader, LogRow};

/// Streams a log through the firmware in QEMU and compares its estimates with the host's; or drives the controller's firmware
/// through a scenario, with a simulated vehicle around it.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Log of readings (CSV).
    #[arg(long, value_name = "LOG.csv", required_unless_present = "plant", conflicts_with = "plant")]
    pub log: Option<PathBuf>,
    /// Calibration: TOML or binary record.
    #[arg(long, value_name = "CAL.toml")]
    pub calibration: PathBuf,
    /// Mapping file (TOML) for a log with other columns or units.
    #[arg(long, value_name = "MAP.toml", requires = "log")]
    pub map: Option<PathBuf>,
    /// Estimates to write (CSV).
    #[arg(long, value_name = "EST.csv", requires = "log")]
    pub out: Option<PathBuf>,
    /// Plot to draw (SVG): measured and expected ratio, Kou observed and by the law.
    #[arg(long, value_name = "PICTURE.svg", requires = "log")]
    pub plot: Option<PathBuf>,
    /// Machine file of the vehicle (TOML): closes the loop with a simulated vehicle.
    #[arg(long, value_name = "MACHINE.toml", requires = "scenario")]
    pub plant: Option<PathBuf>,
    /// Scenario of the closed loop (TOML).
    #[arg(long, value_name = "SCENARIO.toml", requires = "plant")]
    pub scenario: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
    /// Firmware to run; by default the one built by `cargo xtask demo` or `cargo xtask test`.
    #[arg(long, value_name = "FIRMWARE.elf")]
    pub firmware: Option<PathBuf>,
}

#[derive(Serialize)]
struct StreamReport {
    #[serde(flatten)]
    figures: Figures,
    health: HealthFigures,
    rows_passed_over: u64,
    samples_per_s: f64,
    mismatches: u64,
    firmware_samples_per_s: f64,
    stack_high_water_bytes: u32,
}

/// Rows in the firmware's queue, and the error that ended reading, if any.
#[derive(Default)]
struct RowsInFlight {
    rows: VecDeque<LogRow>,
    error: Option<InputError>,
}

/// Runs the command.
///
/// # Errors
/// Bad input; a firmware that does not answer; or at least one estimate that differs from the host's.
pub fn run(args: &Args) -> Result<(), Failure> {
    let (calibration, params) = calibration::read_checked(&args.calibration)?;
    let log = match (&args.plant, &args.scenario, &args.log) {
        (Some(plant), Some(scenario), _) => return close_loop(args, plant, scenario, &calibration),
        (_, _, Some(log)) => log,
        _ => return Err(InputError::new("either --log or --plant and --scenario are needed").into()),
    };
    let report = stream(args, log, &calibration, &params)?;
    if args.json {
        print_json(&report)?
    } else {
        print_text(&text(&report))?
    }
    if report.mismatches == 0 {
        Ok(())
    } else {
        Err(Failure::Check(format!("{} estimates of the firmware differ from the host's", report.mismatches)))
    }
}

fn stream(
    args: &Args,
    log_path: &Path,
    calibration: &Calibration,
    params: &Params,
) -> Result<StreamReport, Failure> {
    let mut log = LogReader::open(log_path, &mapping(args.map.as_deref())?)?;
    let mut writer =
        args.out.as_deref().map(|path| EstimateWriter::create(path, &log.carried_names())).transpose()?;
    let record = record_of(calibration)?;
    let mut options = PilOptions::default();
    if let Some(elf) = &args.firmware {
        options.firmware_elf.clone_from(elf);
    }

    let in_flight = RefCell::new(RowsInFlight::default());
    let samples = std::iter::from_fn(|| match log.next()? {
        Ok(row) => {
            let sample = row.sample;
            in_flight.borrow_mut().rows.push_back(row);
            Some(sample)
        }
        Err(error) => {
            in_flight.borrow_mut().error = Some(error);
            None
        }
    });
    let (mut summary, mut trace, mut state) = (Summary::default(), EstimateTrace::default(), State::new());
    let mut health = HealthSummary::default();
    let (mut mismatches, mut unwritten) = (0_u64, None);
    let bar = progress("through the firmware");
    let on_estimate = |_: u64, sample: &Sample, of_firmware: &Estimate| {
        let of_host = step(params, &mut state, sample);
        mismatches += u64::from(!same_bits(&of_host, of_firmware));
        // The report is of the firmware's estimates, not the host's.
        summary.add(of_firmware);
        health.add(of_firmware);
        if let Some(row) = in_flight.borrow_mut().rows.pop_front() {
            trace.push(row.time_s, of_firmware);
            if let Some(writer) = &mut writer
                && unwritten.is_none()
            {
                unwritten = writer.write(&row, of_firmware).err();
            }
        }
        bar.inc(1);
    };
    let PilReport { samples_per_s, status, .. } = pil::run(&options, &record, samples, on_estimate)?;
    bar.finish_and_clear();
    if let Some(error) = in_flight.into_inner().error.or(unwritten) {
        return Err(error.into());
    }
    if let Some(writer) = writer {
        writer.finish()?;
    }
    if let Some(path) = &args.plot {
        trace.draw(path, &format!("Firmware in QEMU on {}", log_path.display()))?;
    }
    Ok(StreamReport {
        figures: summary.figures(),
        health: health.figures(params, &state),
        rows_passed_over: log.skipped_rows(),
        samples_per_s,
        mismatches,
        firmware_samples_per_s: samples_per_s,
        stack_high_water_bytes: status.stack_high_water_bytes,
    })
}

/// The binary record of a calibration.
fn record_of(calibration: &Calibration) -> Result<Vec<u8>, InputError> {
    let mut buffer = vec![0; record::calibration::MAX_LEN];
    let length =
        record::calibration::encode(calibration, &mut buffer).map_err(|e| InputError::new(e.to_string()))?;
    buffer.truncate(length);
    Ok(buffer)
}

/// Runs the controller's firmware in a closed loop with a simulated vehicle.
fn close_loop(
    args: &Args,
    plant_path: &Path,
    scenario: &Path,
    calibration: &Calibration,
) -> Result<(), Failure> {
    let machine = Machine::load(plant_path)?;
    let scenario = Scenario::load(scenario)?;
    let mut options = PilOptions::of_binary(plant::CONTROLLER);
    if let Some(elf) = &args.firmware {
        options.firmware_elf.clone_from(elf);
    }
    let bar = progress("milliseconds of the closed loop");
    let record = record_of(calibration)?;
    let report = plant::run(&options, &machine, calibration, &record, &scenario, |ms| bar.inc(ms))?;
    bar.finish_and_clear();
    if args.json {
        print_json(&report)?;
    } else {
        print_text(&loop_text(&report))?;
    }
    if report.passed {
        return Ok(());
    }
    let broken = report.findings.iter().filter(|finding| !finding.met).count();
    Err(Failure::Check(format!(
        "{}: {broken} expectations not met, {} deadlines missed",
        report.scenario, report.missed_deadlines
    )))
}

fn loop_text(report: &LoopReport) -> String {
    let mut text = format!(
        "{}: {:.1} s simulated, {:.1} times real time; {} outputs, {} valid; {} deadlines missed, {} us late at most, \
         stack {} bytes, outputs' CRC {:08x}",
        report.scenario,
        report.simulated_s,
        report.real_time_factor,
        report.outputs,
        report.valid,
        report.missed_deadlines,
        report.max_jitter_us,
        report.stack_bytes,
        report.outputs_crc32
    );
    for finding in &report.findings {
        let came = finding.came_after_s.map_or("never came".into(), |s| format!("came after {s:.2} s"));
        text += &format!(
            "\n  {} {:.1} to {:.1} s: {}, {came}, {} of {} outputs other",
            if finding.met { "ok  " } else { "NOT " },
            finding.from_s,
            finding.until_s,
            finding.state,
            finding.others,
            finding.outputs
        );
        if let Some(instead) = &finding.instead {
            text += &format!(" (mostly {instead})");
        }
        if let (Some(worst), Some(rms), Some(mean)) =
            (finding.worst_se, finding.rms_se, finding.mean_error_pct)
        {
            text += &format!(
                "; Kou off by {mean:+.1} % on average, {rms:.2} standard errors rms, {worst:.2} worst"
            );
        }
    }
    for update in &report.updates {
        let came = update.came.as_deref().unwrap_or("nothing");
        text += &format!(
            "\n  {} update {} at {:.1} s: {came}{}",
            if update.met { "ok  " } else { "NOT " },
            update.counter,
            update.from_s,
            update.after_s.map_or_else(String::new, |s| format!(" after {s:.2} s"))
        );
    }
    for outage in &report.outages {
        let seconds = |s: Option<f64>| s.map_or_else(|| "never".into(), |s| format!("{s:.2} s"));
        text += &format!(
            "\n  {} power lost at {:.2} s, byte {} of {}: {}; first output after {}, valid after {}; lost: {}",
            if outage.met { "ok  " } else { "NOT " },
            outage.at_s,
            outage.byte,
            outage.during,
            outage.found.unwrap_or("neither old nor new"),
            seconds(outage.first_output_s),
            seconds(outage.valid_s),
            if outage.lost.is_empty() { "nothing".into() } else { outage.lost.join(", ") }
        );
    }
    text
}

fn text(report: &StreamReport) -> String {
    format!(
        "{}\n{}\nfirmware in QEMU: {:.0} samples per second, {} estimates differ from the host's, stack {} bytes at most",
        figures_text(&report.figures),
        report.health.text(),
        report.firmware_samples_per_s,
        report.mismatches,
        report.stack_high_water_bytes
    )
}
