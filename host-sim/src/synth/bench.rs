//! A synthetic bench table: the paper's 45 operating points, on request with twelve more at partial displacement.

use std::io::Write;

use rayon::prelude::*;

use super::instruments::Instruments;
use super::kou_truth;
use kou_identify::ratio_model::{OperatingPoint, RatioModel};
use kou_lumped::machine::Machine;
use kou_records::InputError;

/// Set points of the paper's test grid: r/min, MPa, degC.
const SPEEDS: [f64; 3] = [1000.0, 2000.0, 2800.0];
const PRESSURES: [f64; 5] = [10.0, 20.0, 30.0, 40.0, 50.0];
const TEMPERATURES: [f64; 3] = [30.0, 60.0, 90.0];

/// Set points at partial displacement, which separate compressibility from leakage: r/min, MPa, degC, displacement.
pub const PARTIAL: [[f64; 4]; 12] = {
    let mut all = [[0.0; 4]; 12];
    let (speeds, pressures, alphas) = ([1000.0, 2800.0], [10.0, 30.0, 50.0], [0.3, 0.6]);
    let mut i = 0;
    while i < 12 {
        all[i] = [speeds[i / 6], pressures[i % 3], 60.0, alphas[(i / 3) % 2]];
        i += 1;
    }
    all
};

/// No swash angle is known to 0.1 %: the true displacement at a setting is this much larger than what the table says.
const SETTING_ERROR: f64 = 0.004;

/// Writes the table; with `exact`, readings are the truth and set points are met.
///
/// # Errors
/// A point that the model does not reach, or an output that cannot be written.
pub fn write_bench(
    out: &mut impl Write,
    machine: &Machine,
    model: &dyn RatioModel,
    mut instruments: Option<Instruments>,
    partial: bool,
    origin: &str,
) -> Result<(), InputError> {
    let mut set_points = Vec::new();
    for t in TEMPERATURES {
        for n in SPEEDS {
            set_points.extend(PRESSURES.map(|p| [n, p, t, 1.0]));
        }
    }
    if partial {
        set_points.extend(PARTIAL);
    }
    // A bench holds its set points to some tenths of a per cent, and the table says where it stood.
    let stood: Vec<[f64; 4]> = set_points
        .into_iter()
        .map(|[n, p, t, alpha]| match &mut instruments {
            Some(i) => [n * (1.0 + i.normal(1e-3)), p * (1.0 + i.normal(5e-3)), t + i.normal(0.8), alpha],
            None => [n, p, t, alpha],
        })
        .collect();
    let solved: Vec<(f64, f64)> = stood
        .par_iter()
        .map(|[n, p, t, alpha]| {
            let kou = kou_truth(machine, *n, *p, *t);
            let truly = if *alpha < 1.0 { alpha * (1.0 + SETTING_ERROR) } else { 1.0 };
            let at = OperatingPoint { n_p_rpm: *n, p_h_mpa: *p, p_l_mpa: None, t_b_c: *t, alpha: truly };
            let solved =
                model.solve(&at, kou).map_err(|e| InputError::new(format!("{n} r/min, {p} MPa: {e}")))?;
            Ok((solved.ratio, kou))
        })
        .collect::<Result<_, InputError>>()?;
    let errors =
        instruments.as_ref().map_or_else(|| "No errors of instruments.".to_string(), Instruments::describe);
    let mut text = format!(
        "# SYNTHETIC bench table, not measured: machine `{}`, {origin}.\n\
         # Leakage truth: three laminar gaps (piston, slipper, valve plate), not quadratic; in column kou_true.\n# {errors}\n",
        machine.name()
    );
    if partial {
        text += "# At partial displacement the true setting is 0.4 % larger than column alpha says.\n";
    }
    text += if partial {
        "n_p_rpm,p_h_mpa,t_b_c,ratio,alpha,kou_true\n"
    } else {
        "n_p_rpm,p_h_mpa,t_b_c,ratio,kou_true\n"
    };
    for ([n, p, t, alpha], (ratio, kou)) in stood.into_iter().zip(solved) {
        let [n_seen, n_m, p_seen, t_seen] = match &mut instruments {
            Some(i) => [i.pump_speed(n), i.motor_speed(n * ratio), i.pressure(p), i.temperature(t)],
            None => [n, n * ratio, p, t],
        };
        text += &format!("{n_seen:.2},{p_seen:.3},{t_seen:.2},{:.6}", n_m / n_seen);
        text += &if partial { format!(",{alpha},{kou:.6}\n") } else { format!(",{kou:.6}\n") };
    }
    out.write_all(text.as_bytes()).map_err(|e| InputError::new(format!("cannot be written: {e}")))
}
