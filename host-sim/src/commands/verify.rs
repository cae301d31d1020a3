//! `host-sim verify`: the calibrated estimator against the lumped model of the machine, forward and inverse.
//!
//! The lumped model is of the machine as identified: displacement and bulk modulus of the calibration, not of the file.
//! The points fill the envelope, and the surrogate was fitted to none of them.

use kou_estimator::model::flow_balance::OperatingPoint as EstimatorPoint;
use kou_estimator::units::{Celsius, LeakageCoefficient, Megapascal, Micros, Ratio, RevPerMin};
use kou_estimator::{Calibration, Params, Reading, Sample, State, step};
use rayon::prelude::*;
use serde::Serialize;

use super::calibrated_args::CalibratedArgs;
use super::failure::Failure;
use super::output::{print_json, print_text};
use crate::replay::reason_label;
use kou_identify::envelope::Envelope;
use kou_identify::lumped_plant::corrected_machine;
use kou_identify::surrogate;
use kou_identify::{LumpedPlant, MachineCorrection, OperatingPoint, PlantModel, ReducedPlant};
use kou_lumped::machine::Machine;
use kou_records::InputError;

/// Allowed mean and largest error of the ratio, and mean error of Kou by the inverse in per cent.
const LIMITS: [f64; 3] = [1e-4, 5e-4, 0.5];

/// Compares the calibrated estimator with the lumped model over the envelope.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Machine and calibration.
    #[command(flatten)]
    pub given: CalibratedArgs,
    /// Points to compare at.
    #[arg(long, default_value_t = 200, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub points: u32,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

/// Estimator and lumped model at one point.
#[derive(Debug, Clone, Serialize)]
struct PointComparison {
    n_p_rpm: f64,
    p_h_mpa: f64,
    t_b_c: f64,
    alpha: f64,
    kou: f64,
    ratio_full: f64,
    ratio_error: f64,
    kou_error_pct: f64,
}

#[derive(Serialize)]
struct VerifyReport {
    points: usize,
    not_steady: usize,
    ratio_error_mean: f64,
    ratio_error_max: f64,
    kou_error_mean_pct: f64,
    kou_error_max_pct: f64,
    worst: Option<PointComparison>,
    worst_kou: Option<PointComparison>,
    passed: bool,
}

/// Runs the command.
///
/// # Errors
/// Bad input, or errors above the limits.
pub fn run(args: &Args) -> Result<(), Failure> {
    let (machine, calibration, params) = args.given.read()?;
    let correction = correction_of(&calibration, &machine);
    let machine = corrected_machine(&machine, correction).map_err(|e| e.at_file(&args.given.calibration))?;
    let full = LumpedPlant::new(&machine).map_err(|e| e.at_file(&args.given.machine))?;
    let theory = ReducedPlant::new(&machine)?;
    let envelope = Envelope::default();
    let compared: Vec<Option<PointComparison>> = (surrogate::POINTS + 1..=surrogate::POINTS + args.points)
        .into_par_iter()
        .map(|index| {
            let (at, kou) = envelope.point(index, &theory);
            let Ok(solved) = full.solve(&at, kou) else { return Ok(None) };
            compare(&params, &at, kou, solved.ratio).map(Some)
        })
        .collect::<Result<_, Failure>>()?;
    let not_steady = compared.iter().filter(|c| c.is_none()).count();
    let report = summarise(compared.into_iter().flatten().collect(), not_steady);
    if args.json {
        print_json(&report)?
    } else {
        print_text(&text(&report))?
    }
    if report.passed {
        Ok(())
    } else {
        Err(Failure::Check("the estimator is not as good as it must be".into()))
    }
}

/// Correction of the machine file in the calibration.
fn correction_of(calibration: &Calibration, machine: &Machine) -> MachineCorrection {
    MachineCorrection {
        displacement: f64::from(calibration.reduced.pump_displacement.get())
            / machine.pump().displacement_cm3_per_rev,
        bulk: f64::from(calibration.oil.bulk_modulus_mpa) / machine.oil().bulk_modulus_mpa,
    }
}

#[allow(clippy::cast_possible_truncation, reason = "the estimator works in f32")]
fn compare(
    params: &Params,
    at: &OperatingPoint,
    kou: f64,
    ratio_full: f64,
) -> Result<PointComparison, Failure> {
    let point = EstimatorPoint {
        pump_speed: RevPerMin(at.n_p_rpm as f32),
        high_pressure: Megapascal(at.p_h_mpa as f32),
        low_pressure: params.low_pressure(),
        oil_temperature: Celsius(at.t_b_c as f32),
        displacement: Ratio(at.alpha as f32),
    };
    let forward = params.reduced().balance(&point).ratio(LeakageCoefficient(kou as f32));
    // The inverse, through all stages of the estimator.
    let now = Micros(1_000_000);
    let mut sample = Sample::empty(now);
    sample.pump_speed = Reading::new(now, point.pump_speed);
    sample.motor_speed = Reading::new(now, RevPerMin((at.n_p_rpm * ratio_full) as f32));
    sample.high_pressure = Reading::new(now, point.high_pressure);
    sample.oil_temperature = Reading::new(now, point.oil_temperature);
    sample.displacement = Reading::new(now, point.displacement);
    let seen = step(params, &mut State::new(), &sample).observed.map_err(|reason| {
        InputError::new(format!(
            "the estimator rejects a point of the envelope ({}): {:.0} r/min, {:.1} MPa, {:.0} degC, displacement {:.2}",
            reason_label(reason),
            at.n_p_rpm,
            at.p_h_mpa,
            at.t_b_c,
            at.alpha
        ))
    })?;
    Ok(PointComparison {
        n_p_rpm: at.n_p_rpm,
        p_h_mpa: at.p_h_mpa,
        t_b_c: at.t_b_c,
        alpha: at.alpha,
        kou,
        ratio_full,
        ratio_error: f64::from(forward.get()) - ratio_full,
        kou_error_pct: 100.0 * (f64::from(seen.kou.get()) / kou - 1.0),
    })
}

fn summarise(compared: Vec<PointComparison>, not_steady: usize) -> VerifyReport {
    let n = compared.len().max(1) as f64;
    let worst = |of: fn(&PointComparison) -> f64| {
        compared.iter().max_by(|a, b| of(a).abs().total_cmp(&of(b).abs())).cloned()
    };
    let mean = |of: fn(&PointComparison) -> f64| compared.iter().map(|c| of(c).abs()).sum::<f64>() / n;
    let (by_ratio, by_kou) = (worst(|c| c.ratio_error), worst(|c| c.kou_error_pct));
    let ratio_error_mean = mean(|c| c.ratio_error);
    let ratio_error_max = by_ratio.as_ref().map_or(0.0, |c| c.ratio_error.abs());
    let kou_error_mean_pct = mean(|c| c.kou_error_pct);
    let within = [ratio_error_mean, ratio_error_max, kou_error_mean_pct].into_iter().zip(LIMITS);
    VerifyReport {
        points: compared.len(),
        not_steady,
        ratio_error_mean,
        ratio_error_max,
        kou_error_mean_pct,
        kou_error_max_pct: by_kou.as_ref().map_or(0.0, |c| c.kou_error_pct.abs()),
        worst: by_ratio,
        worst_kou: by_kou,
        // A comparison at few points proves nothing.
        passed: compared.len() > 9 * not_steady && within.into_iter().all(|(error, limit)| error <= limit),
    }
}

fn text(report: &VerifyReport) -> String {
    let mut text = format!(
        "{} points: error of the ratio {:.2e} mean, {:.2e} worst; error of Kou {:.2} % mean, {:.1} % worst",
        report.points,
        report.ratio_error_mean,
        report.ratio_error_max,
        report.kou_error_mean_pct,
        report.kou_error_max_pct
    );
    if report.not_steady > 0 {
        text += &format!("; {} points have no steady state in the lumped model", report.not_steady);
    }
    if let Some(w) = &report.worst {
        text += &format!(
            "\nworst ratio at {:.0} r/min, {:.1} MPa, {:.0} degC, displacement {:.2}, Kou {:.4}",
            w.n_p_rpm, w.p_h_mpa, w.t_b_c, w.alpha, w.kou
        );
    }
    text
}
