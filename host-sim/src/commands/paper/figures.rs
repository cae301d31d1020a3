//! Data of the paper's figures 3, 4, 5, 7 and 8 for a machine.

use kou_lumped::integrator::Integrator;
use kou_lumped::oil::ATMOSPHERE_PA;
use kou_lumped::stepping::advance;
use kou_lumped::transient::StepResponse;
use kou_lumped::waveforms::WaveformRecorder;
use kou_lumped::{LoadCondition, LumpedModel, SolverSettings, SteadyPoint};

use super::conditions::{KOU_LOSS, KOU_RIPPLE, KOU_STEP, RIPPLE_RPM, RatioRow, T_B_C, steady_case};
use crate::commands::failure::Failure;
use crate::plots::{Chart, Series};

/// A figure: name of its files, columns of its CSV file, and its chart.
pub(super) struct PaperFigure {
    pub(super) name: &'static str,
    pub(super) columns: [&'static str; 2],
    pub(super) chart: Chart,
}

pub(super) fn port_areas(model: &LumpedModel) -> Result<PaperFigure, Failure> {
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
    Ok(PaperFigure {
        name: "fig3_port_areas",
        columns: ["cylinder_angle_deg", "area_mm2"],
        chart: Chart::new(
            "Fig. 3: port areas to the high line of two adjacent pump chambers",
            "cylinder angle, deg",
            "area, mm2",
            vec![Series::line("chamber 1", curve(0.0)), Series::line("chamber 2", curve(pitch))],
        ),
    })
}

pub(super) fn bulk_modulus(model: &LumpedModel) -> Result<PaperFigure, Failure> {
    let oil = model.oil(T_B_C)?;
    let points = (0..=600).map(|k| {
        let p = 0.1 * f64::from(k);
        (p, oil.bulk_modulus_pa(p * 1.0e6 + ATMOSPHERE_PA) * 1.0e-6)
    });
    Ok(PaperFigure {
        name: "fig4_bulk_modulus",
        columns: ["p_mpa", "bulk_modulus_mpa"],
        chart: Chart::new(
            "Fig. 4: bulk modulus by Wylie's model",
            "gauge pressure, MPa",
            "bulk modulus, MPa",
            vec![Series::line("beta", points)],
        ),
    })
}

pub(super) fn ripple(model: &LumpedModel) -> Result<PaperFigure, Failure> {
    let settings = SolverSettings { step_deg: 0.1, ..SolverSettings::default() };
    let mut series = Vec::new();
    for p in [20.0, 40.0] {
        let operating = steady_case(LoadCondition::HighPressureMpa(p), RIPPLE_RPM, KOU_RIPPLE);
        let plant = model.plant(operating.t_b_c, operating.kou_l_min_mpa)?;
        let (_, mut state, inputs) = SteadyPoint::solve_state(&plant, model, &operating, &settings)?;
        let mut integrator = Integrator::new(&plant, settings.method);
        let (start_s, h) = (state.time_s, settings.step_deg / 6.0 / RIPPLE_RPM);
        state.restart();
        let mut recorder = WaveformRecorder::new(&plant, 1);
        advance(&mut integrator, &mut state, &inputs, h, 1200, &mut recorder)?;
        series.push(Series::line(
            format!("p_H = {p} MPa"),
            recorder.samples().iter().map(|row| (row.time_s - start_s, row.p_node_mpa[0] - p)),
        ));
    }
    Ok(PaperFigure {
        name: "fig5_ripple",
        columns: ["time_s", "p_h_minus_mean_mpa"],
        chart: Chart::new(
            "Fig. 5: ripple of the high pressure at 1000 r/min",
            "time, s",
            "high pressure less its mean, MPa",
            series,
        ),
    })
}

pub(super) fn step_response(free: &StepResponse, leaking: &StepResponse) -> PaperFigure {
    let curve =
        |r: &StepResponse| -> Vec<(f64, f64)> { r.trace.iter().map(|row| (row[0], row[1])).collect() };
    PaperFigure {
        name: "fig7_step",
        columns: ["time_s", "n_m_rpm"],
        chart: Chart::new(
            "Fig. 7: step to full swash, 2000 r/min, 1671 N m",
            "time, s",
            "motor speed, r/min",
            vec![
                Series::line("without leakage", curve(free).into_iter()),
                Series::line(format!("Kou = {KOU_STEP} (L/min)/MPa"), curve(leaking).into_iter()),
            ],
        ),
    }
}

pub(super) fn ratio_over_pressure(ratios: &[RatioRow]) -> PaperFigure {
    PaperFigure {
        name: "fig8_ratio",
        columns: ["p_h_mpa", "ratio"],
        chart: Chart::new(
            "Fig. 8: steady speed ratio at 2000 r/min",
            "high pressure, MPa",
            "speed ratio",
            vec![
                Series::line("without leakage", ratios.iter().map(|row| (row.p_h_mpa, row.leak_free))),
                Series::line(
                    format!("Kou = {KOU_LOSS} (L/min)/MPa"),
                    ratios.iter().map(|row| (row.p_h_mpa, row.leaking)),
                ),
            ],
        ),
    }
}
