//! A synthetic drive log: a tracked vehicle steering for eight minutes, with sensor faults and, near the end, a leak.

use std::f64::consts::TAU;
use std::io::{self, Write};

use kou_estimator::reduced::ReducedModel;

use super::noise::{DRIVE, Noise};
use super::{kou_truth, ratio};
use crate::machine::Machine;

const PERIOD_S: f64 = 0.1;
const ROWS: u32 = 4800;
/// From here on the machine leaks more than when it was calibrated.
const LEAK_FROM_S: f64 = 340.0;
const LEAK_FACTOR: f64 = 1.35;

/// Writes the log.
///
/// # Errors
/// When the output cannot be written.
pub fn write_drive(
    out: &mut impl Write,
    machine: &Machine,
    model: &ReducedModel,
    seed: u64,
) -> io::Result<()> {
    let mut noise = Noise::new(seed);
    writeln!(
        out,
        "# SYNTHETIC drive log, not recorded: machine `{}`, reduced model, seed {seed}.",
        machine.name()
    )?;
    writeln!(
        out,
        "# Leakage truth: three laminar gaps, not quadratic, in kou_true; {LEAK_FACTOR} times from {LEAK_FROM_S} s on."
    )?;
    writeln!(
        out,
        "# Random errors, 1 sigma: each speed {} %, pressure {} MPa, temperature {} K. Sensor faults are put in on purpose.",
        100.0 * DRIVE.speed,
        DRIVE.pressure_mpa,
        DRIVE.temperature_k
    )?;
    writeln!(out, "time_s,n_p_rpm,n_m_rpm,p_h_mpa,t_b_c,alpha,kou_true")?;
    for row in 0..ROWS {
        let time_s = f64::from(row) * PERIOD_S;
        let [n, p, t, alpha] = operating_point(time_s);
        let worn = if time_s >= LEAK_FROM_S { LEAK_FACTOR } else { 1.0 };
        let kou = worn * kou_truth(machine, n, p, t);
        let n_m = if alpha == 0.0 { 0.0 } else { n * ratio(model, machine, [n, p, t, alpha], kou) };
        let n_p_seen = n * (1.0 + noise.normal(DRIVE.speed));
        let n_m_seen = n_m * (1.0 + noise.normal(DRIVE.speed));
        let p_seen = p + noise.normal(DRIVE.pressure_mpa);
        let t_seen = t + noise.normal(DRIVE.temperature_k);
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
        writeln!(out, "{time_s:.1},{n_p_seen:.2},{n_m_cell},{p_cell},{t_cell},{alpha:.3},{kou:.5}")?;
    }
    Ok(())
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
