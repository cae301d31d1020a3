//! Synthetic bench points in memory: the paper's grid, with a model as truth.
#![allow(dead_code, reason = "each test binary uses its own part")]

use host_sim::synth::{Gaps, PARTIAL};
use kou_identify::calibration::{SensorClass, Settings};
use kou_identify::ratio_model::{OperatingPoint, RatioModel};
use kou_identify::{Identification, TERMS, normalised, phi};
use kou_lumped::machine::Machine;
use kou_records::BenchPoint;
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
    points_of(&Gaps::default(), machine, model, partial)
}

/// The same with a leakage of other gaps.
pub fn points_of(gaps: &Gaps, machine: &Machine, model: &dyn RatioModel, partial: bool) -> Vec<BenchPoint> {
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
            let at = OperatingPoint { n_p_rpm: n, p_h_mpa: p, p_l_mpa: None, t_b_c: t, alpha: truly };
            let ratio = model.solve(&at, gaps.kou(machine, n, p, t)).unwrap().ratio;
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
    truth_at(machine, point.n_p_rpm, point.p_h_mpa, point.t_b_c)
}

pub fn truth_at(machine: &Machine, n_p_rpm: f64, p_h_mpa: f64, t_b_c: f64) -> f64 {
    Gaps::default().kou(machine, n_p_rpm, p_h_mpa, t_b_c)
}

/// Relative errors of Kou over points at full displacement, in per cent.
#[derive(Debug, Clone, Copy)]
pub struct KouError {
    pub mean: f64,
    pub max: f64,
    pub rms: f64,
}

impl KouError {
    fn over(errors: &[f64]) -> Self {
        let n = errors.len() as f64;
        Self {
            mean: errors.iter().map(|e| e.abs()).sum::<f64>() / n,
            max: errors.iter().map(|e| e.abs()).fold(0.0, f64::max),
            rms: (errors.iter().map(|e| e * e).sum::<f64>() / n).sqrt(),
        }
    }
}

/// Mean and largest relative error of the law's Kou over the full-displacement points, in per cent.
pub fn kou_error_pct(machine: &Machine, result: &Identification) -> (f64, f64) {
    let error = kou_error_of(&Gaps::default(), machine, result);
    (error.mean, error.max)
}

/// Error of the law against a leakage of these gaps.
pub fn kou_error_of(gaps: &Gaps, machine: &Machine, result: &Identification) -> KouError {
    let errors: Vec<f64> = result
        .points
        .iter()
        .filter(|p| p.point.alpha == 1.0)
        .map(|p| {
            let truly = gaps.kou(machine, p.point.n_p_rpm, p.point.p_h_mpa, p.point.t_b_c);
            100.0 * (p.kou_law / truly - 1.0)
        })
        .collect();
    KouError::over(&errors)
}

/// Error of the quadratic that is fitted to the truth itself, relatively: none has a smaller root mean square.
pub fn best_quadratic_of(gaps: &Gaps, machine: &Machine, result: &Identification) -> KouError {
    let points: Vec<BenchPoint> = result.points.iter().map(|p| p.point).filter(|p| p.alpha == 1.0).collect();
    let rows: Vec<f64> = points
        .iter()
        .flat_map(|p| {
            let k = gaps.kou(machine, p.n_p_rpm, p.p_h_mpa, p.t_b_c);
            phi(normalised(&result.fit.law, p.n_p_rpm, p.p_h_mpa, p.t_b_c)).map(|f| f / k)
        })
        .collect();
    let columns = DMatrix::from_row_iterator(points.len(), TERMS.len(), rows);
    let ones = DVector::from_element(points.len(), 1.0);
    let solution = columns.clone().svd(true, true).solve(&ones, 1e-12).unwrap();
    let errors: Vec<f64> = (columns * solution - ones).iter().map(|e| 100.0 * e).collect();
    KouError::over(&errors)
}
