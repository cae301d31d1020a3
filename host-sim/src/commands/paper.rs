//! `host-sim paper`: the paper's model figures for a machine, and published against computed values.
//!
//! Figures 3 (port areas), 4 (bulk modulus), 5 (ripple), 7 (step response) and 8 (ratio over pressure), each as CSV and
//! SVG. The published values hold for the machine of the paper; with another machine the table shows how it differs and
//! the command ends with exit code 1.

use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde::Serialize;

use super::lines::{Lines, Series};
use super::{Failure, print_json, print_text, progress};
use kou_lumped::integrator::Integrator;
use kou_lumped::machine::Machine;
use kou_lumped::oil::ATMOSPHERE_PA;
use kou_lumped::stepping::advance;
use kou_lumped::transient::{StepResponse, swash_step};
use kou_lumped::waveforms::WaveformRecorder;
use kou_lumped::{LoadCondition, LumpedModel, SolverSettings, SteadyCase, SteadyPoint};
use kou_records::InputError;

/// Conditions of the paper's figures 7 and 8.
const SPEED_RPM: f64 = 2000.0;
const LOAD_NM: f64 = 1671.0;
/// Leakage that reproduces fig. 7, and the one that reproduces the losses of fig. 8.
const KOU_STEP: f64 = 0.113;
const KOU_LOSS: f64 = 0.101;
/// Leakage, speed and pressures of fig. 5; Kou is the one the paper identifies near 1000 r/min.
const KOU_RIPPLE: f64 = 0.058;
const RIPPLE_RPM: f64 = 1000.0;
const T_B_C: f64 = 60.0;

/// Draws the paper's model figures and compares published with computed values.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Machine file (TOML).
    #[arg(long, value_name = "MACHINE.toml")]
    pub machine: PathBuf,
    /// Folder for the figures; it is made.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Print one JSON object.
    #[arg(long)]
    pub json: bool,
}

#[derive(Serialize)]
struct Value {
    what: &'static str,
    unit: &'static str,
    published: f64,
    computed: f64,
    tolerance: f64,
    within: bool,
}

#[derive(Serialize)]
struct Report {
    values: Vec<Value>,
    figures: Vec<String>,
    within: bool,
}

/// Runs the command.
///
/// # Errors
/// Bad input, a file that cannot be written, or a computed value outside the published one's tolerance.
pub fn run(args: &Args) -> Result<(), Failure> {
    let model = LumpedModel::new(&Machine::load(&args.machine)?)?;
    std::fs::create_dir_all(&args.out)
        .map_err(|e| InputError::new(format!("folder cannot be made: {e}")).at_file(&args.out))?;
    let bar = progress("paper");
    let (free, leaking) = (step(&model, 0.0)?, step(&model, KOU_STEP)?);
    bar.inc(2);
    let ratios = ratio_curves(&model)?;
    bar.inc(1);
    let figures = [
        ("fig3_port_areas", port_areas(&model)?),
        ("fig4_bulk_modulus", bulk_modulus(&model)?),
        ("fig5_ripple", ripple(&model)?),
        ("fig7_step", step_lines(&free, &leaking)),
        ("fig8_ratio", ratio_lines(&ratios)),
    ];
    bar.inc(1);
    let mut names = Vec::new();
    for (name, lines) in &figures {
        let (csv, svg) = (args.out.join(format!("{name}.csv")), args.out.join(format!("{name}.svg")));
        lines.write_csv(&csv)?;
        lines.draw(&svg)?;
        names.extend([format!("{name}.csv"), format!("{name}.svg")]);
    }
    bar.finish_and_clear();
    let values = compare(&free, &leaking, &ratios);
    write_table(&args.out.join("published_and_computed.csv"), &values)?;
    let within = values.iter().all(|v| v.within);
    let report = Report { values, figures: names, within };
    if args.json {
        print_json(&report)?;
    } else {
        print_text(&text(&report))?;
    }
    if within {
        Ok(())
    } else {
        Err(Failure::Check(
            "computed values differ from the published ones by more than their tolerance".into(),
        ))
    }
}

fn at(condition: LoadCondition, n_p_rpm: f64, kou: f64) -> SteadyCase {
    SteadyCase { n_p_rpm, condition, t_b_c: T_B_C, alpha: 1.0, kou_l_min_mpa: kou }
}

fn step(model: &LumpedModel, kou: f64) -> Result<StepResponse, Failure> {
    Ok(swash_step(
        model,
        &at(LoadCondition::LoadNm(LOAD_NM), SPEED_RPM, kou),
        &SolverSettings::default(),
        2.0,
    )?)
}

/// High pressure, ratio without and with leakage.
fn ratio_curves(model: &LumpedModel) -> Result<Vec<[f64; 3]>, Failure> {
    let pressures: Vec<f64> = (0..=16).map(|k| 10.0 + 2.5 * f64::from(k)).collect();
    let curves: Result<Vec<_>, _> = pressures
        .into_par_iter()
        .map(|p| {
            let ratio = |kou| {
                SteadyPoint::solve(model, &at(LoadCondition::HighPressureMpa(p), SPEED_RPM, kou))
                    .map(|s| s.ratio)
            };
            Ok([p, ratio(0.0)?, ratio(KOU_LOSS)?])
        })
        .collect();
    curves
}

fn port_areas(model: &LumpedModel) -> Result<Lines, Failure> {
    let plant = model.plant(T_B_C, 0.0)?;
    let cd = model.machine().pump().valve_plate.as_ref().map_or(1.0, |plate| plate.discharge_coefficient);
    let pitch = 360.0 / model.machine().pump().pistons as f64;
    let curve = |behind_deg: f64| {
        let plant = &plant;
        (0..=3600).map(move |k| {
            let angle = 0.1 * f64::from(k);
            (angle, plant.cd_area_mm2(0, (angle - behind_deg).to_radians()).0 / cd)
        })
    };
    Ok(Lines {
        title: "Fig. 3: port areas to the high line of two adjacent pump chambers",
        x: "cylinder_angle_deg",
        y: "area_mm2",
        series: vec![Series::new("chamber 1", curve(0.0)), Series::new("chamber 2", curve(pitch))],
    })
}

fn bulk_modulus(model: &LumpedModel) -> Result<Lines, Failure> {
    let oil = model.oil(T_B_C)?;
    let points = (0..=600).map(|k| {
        let p = 0.1 * f64::from(k);
        (p, oil.bulk_modulus_pa(p * 1.0e6 + ATMOSPHERE_PA) * 1.0e-6)
    });
    Ok(Lines {
        title: "Fig. 4: bulk modulus by Wylie's model",
        x: "p_mpa",
        y: "bulk_modulus_mpa",
        series: vec![Series::new("beta", points)],
    })
}

fn ripple(model: &LumpedModel) -> Result<Lines, Failure> {
    let settings = SolverSettings { step_deg: 0.1, ..SolverSettings::default() };
    let mut series = Vec::new();
    for p in [20.0, 40.0] {
        let operating = at(LoadCondition::HighPressureMpa(p), RIPPLE_RPM, KOU_RIPPLE);
        let plant = model.plant(operating.t_b_c, operating.kou_l_min_mpa)?;
        let (_, mut state, inputs) = SteadyPoint::solve_state(&plant, model, &operating, &settings)?;
        let mut integrator = Integrator::new(&plant, settings.method);
        let (start_s, h) = (state.time_s, settings.step_deg / 6.0 / RIPPLE_RPM);
        state.restart();
        let mut recorder = WaveformRecorder::new(&plant, 1);
        advance(&mut integrator, &mut state, &inputs, h, 1200, &mut recorder)?;
        series.push(Series::new(
            format!("p_H = {p} MPa"),
            recorder.samples().iter().map(|row| (row.time_s - start_s, row.p_node_mpa[0] - p)),
        ));
    }
    Ok(Lines {
        title: "Fig. 5: ripple of the high pressure at 1000 r/min",
        x: "time_s",
        y: "p_h_minus_mean_mpa",
        series,
    })
}

fn step_lines(free: &StepResponse, leaking: &StepResponse) -> Lines {
    let curve =
        |r: &StepResponse| -> Vec<(f64, f64)> { r.trace.iter().map(|row| (row[0], row[1])).collect() };
    Lines {
        title: "Fig. 7: step to full swash, 2000 r/min, 1671 N m",
        x: "time_s",
        y: "n_m_rpm",
        series: vec![
            Series::new("without leakage", curve(free).into_iter()),
            Series::new(format!("Kou = {KOU_STEP} (L/min)/MPa"), curve(leaking).into_iter()),
        ],
    }
}

fn ratio_lines(ratios: &[[f64; 3]]) -> Lines {
    Lines {
        title: "Fig. 8: steady speed ratio at 2000 r/min",
        x: "p_h_mpa",
        y: "ratio",
        series: vec![
            Series::new("without leakage", ratios.iter().map(|r| (r[0], r[1]))),
            Series::new(format!("Kou = {KOU_LOSS} (L/min)/MPa"), ratios.iter().map(|r| (r[0], r[2]))),
        ],
    }
}

fn compare(free: &StepResponse, leaking: &StepResponse, ratios: &[[f64; 3]]) -> Vec<Value> {
    let at = |p: f64| ratios.iter().find(|r| r[0] == p).copied().unwrap_or([f64::NAN; 3]);
    let value = |what, unit, published: f64, computed: f64, tolerance: f64| Value {
        what,
        unit,
        published,
        computed,
        tolerance,
        within: (published - computed).abs() <= tolerance,
    };
    let compression = |p: f64| 100.0 * (1.0 - at(p)[1]);
    let leakage = |p: f64| 100.0 * (at(p)[1] - at(p)[2]);
    vec![
        value("motor speed without leakage", "r/min", 1922.0, free.n_m_steady_rpm, 4.0),
        value("motor speed with leakage", "r/min", 1803.0, leaking.n_m_steady_rpm, 4.0),
        value("loss by compressibility at 25 MPa", "%", 2.54, compression(25.0), 0.06),
        value("loss by compressibility at 45 MPa", "%", 4.91, compression(45.0), 0.06),
        value("loss by leakage at 25 MPa", "%", 3.67, leakage(25.0), 0.1),
        value("loss by leakage at 45 MPa", "%", 6.39, leakage(45.0), 0.1),
    ]
}

fn write_table(path: &Path, values: &[Value]) -> Result<(), Failure> {
    let fail = |e: csv::Error| InputError::new(format!("cannot be written: {e}")).at_file(path);
    let mut writer = csv::Writer::from_path(path).map_err(fail)?;
    for value in values {
        writer.serialize(value).map_err(fail)?;
    }
    writer.flush().map_err(|e| InputError::new(format!("cannot be written: {e}")).at_file(path))?;
    Ok(())
}

fn text(report: &Report) -> String {
    let mut text = format!("{:<36} {:>10} {:>10} {:>9}", "", "published", "computed", "tolerance");
    for v in &report.values {
        let mark = if v.within { "" } else { "  OUTSIDE" };
        text.push_str(&format!(
            "\n{:<36} {:>10.2} {:>10.3} {:>9.2} {}{mark}",
            v.what, v.published, v.computed, v.tolerance, v.unit
        ));
    }
    text
}
