//! A synthetic drive log: a tracked vehicle steering for eight minutes, with sensor faults and, near the end, a leak.

use std::f64::consts::TAU;
use std::io::Write;

use rayon::prelude::*;

use super::instruments::Instruments;
use super::kou_truth;
use kou_identify::ratio_model::{OperatingPoint, RatioModel, ReducedRatio};
use kou_lumped::machine::Machine;
use kou_records::InputError;

const PERIOD_S: f64 = 0.1;
const ROWS: u32 = 4800;
/// Rows between two solutions of the full model.
const KNOT: usize = 10;
/// From here on the machine leaks more than when it was calibrated.
const LEAK_FROM_S: f64 = 340.0;
const LEAK_FACTOR: f64 = 1.35;

/// Writes the log.
///
/// # Errors
/// A point that the model does not reach, or an output that cannot be written.
pub fn write_drive(
    out: &mut impl Write,
    machine: &Machine,
    model: &dyn RatioModel,
    instruments: &mut Instruments,
    origin: &str,
) -> Result<(), InputError> {
    let mut text = format!(
        "# SYNTHETIC drive log, not recorded: machine `{}`, {origin}.\n\
         # Leakage truth: three laminar gaps, not quadratic, in kou_true; {LEAK_FACTOR} times from {LEAK_FROM_S} s on.\n\
         # {} Sensor faults are put in on purpose.\n\
         time_s,n_p_rpm,n_m_rpm,p_h_mpa,t_b_c,alpha,kou_true\n",
        machine.name(),
        instruments.describe()
    );
    let ratios = true_ratios(machine, model)?;
    for (row, true_ratio) in (0..ROWS).zip(ratios) {
        let time_s = f64::from(row) * PERIOD_S;
        let [n, p, t, alpha] = operating_point(time_s);
        let kou = true_kou(machine, time_s);
        let n_p_seen = instruments.pump_speed(n);
        let n_m_seen = instruments.motor_speed(n * true_ratio);
        let p_seen = instruments.pressure(p);
        let t_seen = instruments.temperature(t);
        let p_cell = match row {
            1000..1020 => "open".to_string(),
            2500..2505 => "NaN".to_string(),
            2505..2510 => format!("{:.2}", p_seen * 10.0),
            _ => format!("{p_seen:.3}"),
        };
        let n_m_cell = match row {
            1500..1530 => String::new(),
            3000..3010 => "stuck".to_string(),
            _ => format!("{n_m_seen:.2}"),
        };
        let t_cell = match row {
            2000..2030 => "short".to_string(),
            2510..2515 => "inf".to_string(),
            _ => format!("{t_seen:.2}"),
        };
        text += &format!("{time_s:.1},{n_p_seen:.2},{n_m_cell},{p_cell},{t_cell},{alpha:.3},{kou:.5}\n");
    }
    out.write_all(text.as_bytes()).map_err(|e| InputError::new(format!("cannot be written: {e}")))
}

fn true_kou(machine: &Machine, time_s: f64) -> f64 {
    let [n, p, t, _] = operating_point(time_s);
    let worn = if time_s >= LEAK_FROM_S { LEAK_FACTOR } else { 1.0 };
    worn * kou_truth(machine, n, p, t)
}

/// Ratio of every row. The full model is solved at every tenth row; in between, what it adds to the reduced model (some
/// 1e-3 of ratio) is interpolated, which leaves errors of some 1e-5, and where displacement or leakage jump some 1e-4 for
/// less than a second.
fn true_ratios(machine: &Machine, model: &dyn RatioModel) -> Result<Vec<f64>, InputError> {
    let reduced = ReducedRatio::new(machine)?;
    let at = |row: usize| {
        let time_s = row as f64 * PERIOD_S;
        let [n_p_rpm, p_h_mpa, t_b_c, alpha] = operating_point(time_s);
        (OperatingPoint { n_p_rpm, p_h_mpa, p_l_mpa: None, t_b_c, alpha }, true_kou(machine, time_s))
    };
    let rows = ROWS as usize;
    let corrections: Vec<f64> = (0..=rows / KNOT)
        .into_par_iter()
        .map(|knot| {
            let (at, kou) = at(knot * KNOT);
            if at.alpha == 0.0 {
                return Ok(0.0);
            }
            let solved =
                model.solve(&at, kou).map_err(|e| InputError::new(format!("row {}: {e}", knot * KNOT)))?;
            Ok(solved.ratio.abs() - reduced.ratio(&at, kou).abs())
        })
        .collect::<Result<_, InputError>>()?;
    Ok((0..rows)
        .map(|row| {
            let (at, kou) = at(row);
            if at.alpha == 0.0 {
                return 0.0;
            }
            let (knot, between) = (row / KNOT, (row % KNOT) as f64 / KNOT as f64);
            let correction = corrections[knot] * (1.0 - between) + corrections[knot + 1] * between;
            reduced.ratio(&at, kou) + at.alpha.signum() * correction
        })
        .collect())
}

/// Pump speed, pressure, oil temperature and displacement of the manoeuvre.
fn operating_point(time_s: f64) -> [f64; 4] {
    let wave = |period_s: f64, phase: f64| (TAU * (time_s / period_s + phase)).sin();
    // Oil warms up from 35 to some 80 degC.
    let t = 35.0 + 47.0 * (1.0 - (-time_s / 150.0).exp());
    if time_s < 20.0 {
        // Idling, no load.
        return [850.0, 1.8, t, 0.0];
    }
    let n = 1850.0 + 550.0 * wave(97.0, 0.1) + 180.0 * wave(23.0, 0.4);
    let p = 27.0 + 9.0 * wave(61.0, 0.0) + 5.0 * wave(17.0, 0.3);
    // Mostly straight at full displacement; steering at partial and, in between, reversed displacement.
    let phase = time_s % 80.0;
    let alpha = match phase {
        p if p < 44.0 => 1.0,
        p if p < 56.0 => 0.55,
        p if p < 68.0 => -0.6,
        _ => 1.0,
    };
    [n, p, t, alpha]
}
