//! Synthetic bench points in memory: the paper's grid, with a model as truth.
#![allow(dead_code, reason = "each test binary uses its own part")]

use host_sim::calibration::{SensorClass, Settings};
use host_sim::identify::ratio_model::{At, RatioModel};
use host_sim::identify::{Identification, TERMS, normalised, phi};
use host_sim::machine::Machine;
use host_sim::record::BenchPoint;
use host_sim::synth::{PARTIAL, kou_truth};
use nalgebra::{DMatrix, DVector};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;

pub fn machine(name: &str) -> Machine {
    Machine::load(&crate::support::root().join("host-sim/machines").join(name)).unwrap()
}

pub fn settings() -> Settings {
    Settings {
        serial: String::new(),
        date: String::new(),
        class: SensorClass::A,
        bench_crc32: 1,
        machine_crc32: 2,
    }
}

/// The 45 points, and the twelve at partial displacement, whose true setting is 0.4 % off.
pub fn points(machine: &Machine, model: &dyn RatioModel, partial: bool) -> Vec<BenchPoint> {
    let mut all = Vec::new();
    for t in [30.0, 60.0, 90.0] {
        for n in [1000.0, 2000.0, 2800.0] {
            all.extend([10.0, 20.0, 30.0, 40.0, 50.0].map(|p| [n, p, t, 1.0]));
        }
    }
    if partial {
        all.extend(PARTIAL);
    }
    all.into_par_iter()
        .enumerate()
        .map(|(i, [n, p, t, alpha])| {
            let truly = if alpha < 1.0 { 1.004 * alpha } else { 1.0 };
            let at = At { n_p_rpm: n, p_h_mpa: p, p_l_mpa: None, t_b_c: t, alpha: truly };
            let ratio = model.solve(&at, kou_truth(machine, n, p, t)).unwrap().ratio;
            BenchPoint { line: i as u64 + 2, n_p_rpm: n, p_h_mpa: p, p_l_mpa: None, t_b_c: t, alpha, ratio }
        })
        .collect()
}

pub fn with_noise(points: &[BenchPoint], relative: f64, seed: u64) -> Vec<BenchPoint> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    points
        .iter()
        .map(|p| {
            let unit: f64 = StandardNormal.sample(&mut random);
            BenchPoint { ratio: p.ratio * (1.0 + relative * unit), ..*p }
        })
        .collect()
}

pub fn truth(machine: &Machine, point: &BenchPoint) -> f64 {
    kou_truth(machine, point.n_p_rpm, point.p_h_mpa, point.t_b_c)
}

/// Mean and largest relative error of the law's Kou over the full-displacement points, in per cent.
pub fn kou_error_pct(machine: &Machine, result: &Identification) -> (f64, f64) {
    let errors: Vec<f64> = result
        .points
        .iter()
        .filter(|p| p.point.alpha == 1.0)
        .map(|p| 100.0 * (p.kou_law / truth(machine, &p.point) - 1.0).abs())
        .collect();
    (errors.iter().sum::<f64>() / errors.len() as f64, errors.iter().copied().fold(0.0, f64::max))
}

/// Mean relative error in per cent of the quadratic that is fitted to the truth itself, relatively.
pub fn best_quadratic_pct(machine: &Machine, result: &Identification) -> f64 {
    let points: Vec<BenchPoint> = result.points.iter().map(|p| p.point).collect();
    let rows: Vec<f64> = points
        .iter()
        .flat_map(|p| {
            let k = truth(machine, p);
            phi(normalised(&result.fit.law, p.n_p_rpm, p.p_h_mpa, p.t_b_c)).map(|f| f / k)
        })
        .collect();
    let columns = DMatrix::from_row_iterator(points.len(), TERMS.len(), rows);
    let ones = DVector::from_element(points.len(), 1.0);
    let solution = columns.clone().svd(true, true).solve(&ones, 1e-12).unwrap();
    100.0 * (columns * solution - ones).abs().mean()
}

pub fn truth_at(machine: &Machine, n_p_rpm: f64, p_h_mpa: f64, t_b_c: f64) -> f64 {
    kou_truth(machine, n_p_rpm, p_h_mpa, t_b_c)
}
