//! `host-sim pil`: the same samples through the firmware in QEMU, every field of every estimate compared with the host's,
//! bit for bit.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::path::PathBuf;

use kou_estimator::calibration::record;
use kou_estimator::{Calibration, Estimate, Params, Sample, State, step};
use serde::Serialize;

use super::identify::mapping;
use super::replay::figures_text;
use super::{Failure, print_json, print_text, progress};
use crate::calibration;
use crate::input::InputError;
use crate::pil::{self, PilError, PilOptions, PilReport, same_bits};
use crate::record::{LogReader, LogRow};
use crate::replay::{EstimateWriter, Figures, HealthFigures, HealthSummary, Summary, Trace, draw};

/// Streams a log through the firmware in QEMU and compares its estimates with the host's.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Log, calibration and outputs: the same as of `replay`.
    #[command(flatten)]
    pub replay: super::replay::Args,
    /// Firmware to run; by default the one built by `cargo xtask demo` or `cargo xtask test`.
    #[arg(long, value_name = "FIRMWARE.elf")]
    pub firmware: Option<PathBuf>,
}

#[derive(Serialize)]
struct Report {
    #[serde(flatten)]
    figures: Figures,
    health: HealthFigures,
    rows_passed_over: u64,
    samples_per_s: f64,
    mismatches: u64,
    firmware_samples_per_s: f64,
    stack_high_water_bytes: u32,
}

impl From<PilError> for Failure {
    fn from(error: PilError) -> Self {
        Self::Check(error.to_string())
    }
}

/// The rows on their way through the firmware, and why reading them ended, if not at the end of the file.
#[derive(Default)]
struct UnderWay {
    rows: VecDeque<LogRow>,
    error: Option<InputError>,
}

/// Runs the command.
///
/// # Errors
/// Bad input; a firmware that does not answer; or at least one estimate that differs from the host's.
pub fn run(args: &Args) -> Result<(), Failure> {
    let (calibration, params) = calibration::read_checked(&args.replay.calibration)?;
    let report = stream(args, &calibration, &params)?;
    if args.replay.json {
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

fn stream(args: &Args, calibration: &Calibration, params: &Params) -> Result<Report, Failure> {
    let mut log = LogReader::open(&args.replay.log, &mapping(args.replay.map.as_deref())?)?;
    let mut writer = args
        .replay
        .out
        .as_deref()
        .map(|path| EstimateWriter::create(path, &log.carried_names()))
        .transpose()?;
    let mut buffer = [0_u8; record::MAX_LEN];
    let length = record::encode(calibration, &mut buffer).map_err(|e| InputError::new(e.to_string()))?;
    let mut options = PilOptions::default();
    if let Some(elf) = &args.firmware {
        options.firmware_elf.clone_from(elf);
    }

    let under_way = RefCell::new(UnderWay::default());
    let samples = std::iter::from_fn(|| match log.next()? {
        Ok(row) => {
            let sample = row.sample;
            under_way.borrow_mut().rows.push_back(row);
            Some(sample)
        }
        Err(error) => {
            under_way.borrow_mut().error = Some(error);
            None
        }
    });
    let (mut summary, mut trace, mut state) = (Summary::default(), Trace::default(), State::new());
    let mut health = HealthSummary::default();
    let (mut mismatches, mut unwritten) = (0_u64, None);
    let bar = progress("through the firmware");
    let on_estimate = |_: u64, sample: &Sample, of_firmware: &Estimate| {
        let of_host = step(params, &mut state, sample);
        mismatches += u64::from(!same_bits(&of_host, of_firmware));
        // What is reported is the firmware's word, not the host's.
        summary.add(of_firmware);
        health.add(of_firmware);
        if let Some(row) = under_way.borrow_mut().rows.pop_front() {
            trace.add(row.time_s, of_firmware);
            if let Some(writer) = &mut writer
                && unwritten.is_none()
            {
                unwritten = writer.write(&row, of_firmware).err();
            }
        }
        bar.inc(1);
    };
    let PilReport { samples_per_s, status, .. } =
        pil::run(&options, buffer.get(..length).unwrap_or_default(), samples, on_estimate)?;
    bar.finish_and_clear();
    if let Some(error) = under_way.into_inner().error.or(unwritten) {
        return Err(error.into());
    }
    if let Some(writer) = writer {
        writer.finish()?;
    }
    if let Some(path) = &args.replay.plot {
        draw(path, &format!("Firmware in QEMU on {}", args.replay.log.display()), &trace)?;
    }
    Ok(Report {
        figures: summary.figures(),
        health: health.figures(params, &state),
        rows_passed_over: log.passed_over(),
        samples_per_s,
        mismatches,
        firmware_samples_per_s: samples_per_s,
        stack_high_water_bytes: status.stack_high_water_bytes,
    })
}

fn text(report: &Report) -> String {
    format!(
        "{}\n{}\nfirmware in QEMU: {:.0} samples per second, {} estimates differ from the host's, stack {} bytes at most",
        figures_text(&report.figures),
        report.health.text(),
        report.firmware_samples_per_s,
        report.mismatches,
        report.stack_high_water_bytes
    )
}
