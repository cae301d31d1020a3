//! A synthetic bench table: the paper's 45 operating points.

use std::io::{self, Write};

use kou_estimator::reduced::ReducedModel;

use super::noise::{BENCH, Noise};
use super::{kou_truth, ratio};
use crate::machine::Machine;

/// Set points of the paper's test grid: r/min, MPa, degC.
const SPEEDS: [f64; 3] = [1000.0, 2000.0, 2800.0];
const PRESSURES: [f64; 5] = [10.0, 20.0, 30.0, 40.0, 50.0];
const TEMPERATURES: [f64; 3] = [30.0, 60.0, 90.0];

/// Writes the table.
///
/// # Errors
/// When the output cannot be written.
pub fn write_bench(
    out: &mut impl Write,
    machine: &Machine,
    model: &ReducedModel,
    seed: u64,
) -> io::Result<()> {
    let mut noise = Noise::new(seed);
    writeln!(
        out,
        "# SYNTHETIC bench table, not measured: machine `{}`, reduced model, seed {seed}.",
        machine.name()
    )?;
    writeln!(
        out,
        "# Leakage truth: three laminar gaps (piston, slipper, valve plate), not quadratic; in column kou_true."
    )?;
    writeln!(
        out,
        "# Random errors, 1 sigma: each speed {} %, pressure {} MPa, temperature {} K. No systematic errors.",
        100.0 * BENCH.speed,
        BENCH.pressure_mpa,
        BENCH.temperature_k
    )?;
    writeln!(out, "n_p_rpm,p_h_mpa,t_b_c,ratio,kou_true")?;
    for t_set in TEMPERATURES {
        for n_set in SPEEDS {
            for p_set in PRESSURES {
                // A bench holds its set points to some tenths of a per cent, and the table says where it stood.
                let n = n_set * (1.0 + noise.normal(1e-3));
                let p = p_set * (1.0 + noise.normal(5e-3));
                let t = t_set + noise.normal(0.8);
                let kou = kou_truth(machine, n, p, t);
                let true_ratio = ratio(model, machine, [n, p, t, 1.0], kou);
                let measured = true_ratio * (1.0 + noise.normal(BENCH.speed) - noise.normal(BENCH.speed));
                let n = n * (1.0 + noise.normal(BENCH.speed));
                let p = p + noise.normal(BENCH.pressure_mpa);
                let t = t + noise.normal(BENCH.temperature_k);
                writeln!(out, "{n:.2},{p:.3},{t:.2},{measured:.6},{kou:.6}")?;
            }
        }
    }
    Ok(())
}
