//! The numbers behind a report: the joint identification beside the paper's two steps and a constant, and curves of the
//! full model.

use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

use kou_identify::advice::{self, Proposal};
use kou_identify::calibration::Settings;
use kou_identify::joint::Prior;
use kou_identify::ratio_model::{Change, OperatingPoint, RatioModel, ReducedRatio, Solved, operating_point};
use kou_identify::secant::{self, Secant};
use kou_identify::{Identification, evaluate, joint_scheme, two_step};
use kou_lumped::SimError;
use kou_lumped::machine::Machine;
use kou_records::BenchPoint;
use kou_records::InputError;

/// One search of the secant method: where it started and what it was told.
#[derive(Debug, Clone)]
pub struct Search {
    /// Start interval.
    pub start: [f64; 2],
    /// Calls in order: Kou and ratio.
    pub calls: Vec<(f64, f64)>,
}

/// Everything that a report shows.
#[derive(Debug)]
pub struct Study {
    /// Joint identification.
    pub joint: Identification,
    /// The paper's two steps.
    pub paper: Identification,
    /// The empirical constant: mean Kou of the slowest points at the highest temperature, without the extreme pressures.
    pub constant: f64,
    /// Relative error of the ratio with the constant, per used point, in per cent.
    pub constant_error_pct: Vec<f64>,
    /// At 2000 r/min or the middle speed: pressure, leak-free ratio, ratio by the law.
    pub fig8: Vec<(f64, f64, f64)>,
    /// Speed of `fig8`.
    pub fig8_rpm: f64,
    /// The point of the case study and its searches.
    pub case: (BenchPoint, Vec<Search>),
    /// Proposals for the next measurement.
    pub advice: Vec<Proposal>,
}

/// Writes down every call.
struct Recorder<'a> {
    model: &'a dyn RatioModel,
    calls: Mutex<Vec<(f64, f64)>>,
}

impl RatioModel for Recorder<'_> {
    fn solve(&self, at: &OperatingPoint, kou: f64) -> Result<Solved, SimError> {
        let solved = self.model.solve(at, kou)?;
        self.calls.lock().unwrap_or_else(PoisonError::into_inner).push((kou, solved.ratio));
        Ok(solved)
    }

    fn changed(&self, change: Change) -> Result<Box<dyn RatioModel + '_>, InputError> {
        self.model.changed(change)
    }
}

impl Study {
    /// Makes the study.
    ///
    /// # Errors
    /// Whatever stops an identification.
    pub fn new(
        machine: &Machine,
        points: &[BenchPoint],
        settings: &Settings,
        model: &dyn RatioModel,
        prior: &Prior,
    ) -> Result<Self, InputError> {
        let joint = joint_scheme::identify(machine, points, settings, Some(model), prior)?;
        let paper = two_step::identify(machine, points, settings, Some(model), &Secant::default())?;
        let used: Vec<BenchPoint> = joint.points.iter().map(|p| p.point).collect();
        let found = model.changed(joint.change)?;

        let constant = empirical_constant(&joint);
        let constant_error_pct = used
            .par_iter()
            .map(|p| {
                found
                    .solve(&operating_point(p), constant)
                    .map_or(f64::NAN, |s| 100.0 * (s.ratio / p.ratio - 1.0))
            })
            .collect();

        let fig8_rpm = nearest(&used, |p| p.n_p_rpm, 2000.0);
        let t_b_c = nearest(&used, |p| p.t_b_c, 60.0);
        let [low, high] = extent(&used, |p| p.p_h_mpa);
        let fig8 = (0..=12)
            .into_par_iter()
            .filter_map(|i| {
                let p_h_mpa = low + (high - low) * f64::from(i) / 12.0;
                let point = BenchPoint {
                    line: 0,
                    n_p_rpm: fig8_rpm,
                    p_h_mpa,
                    p_l_mpa: None,
                    t_b_c,
                    alpha: 1.0,
                    ratio: 1.0,
                };
                let at = operating_point(&point);
                let free = found.solve(&at, 0.0).ok()?.ratio;
                let leaking = found.solve(&at, evaluate(&joint.fit, &point).max(0.0)).ok()?.ratio;
                Some((p_h_mpa, free, leaking))
            })
            .collect();

        let case = case_study(&used, found.as_ref());
        let measured: Vec<OperatingPoint> = used.iter().map(operating_point).collect();
        let advice = match &joint.solution {
            Some(solution) => {
                advice::advise(&measured, &joint.fit, &ReducedRatio::new(machine)?, solution, prior)?
            }
            None => Vec::new(),
        };
        Ok(Self { joint, paper, constant, constant_error_pct, fig8, fig8_rpm, case, advice })
    }
}

/// Searches from the paper's three intervals at the point nearest to its case study.
fn case_study(used: &[BenchPoint], model: &dyn RatioModel) -> (BenchPoint, Vec<Search>) {
    let distance = |p: &BenchPoint| {
        ((p.n_p_rpm - 999.23) / 1000.0).hypot((p.p_h_mpa - 31.06) / 31.0).hypot((p.t_b_c - 58.24) / 58.0)
    };
    let point = used.iter().filter(|p| p.alpha == 1.0).min_by(|a, b| distance(a).total_cmp(&distance(b)));
    let point = *point.unwrap_or(&used[0]);
    let searches = [[0.006, 0.09], [0.036, 0.039], [0.0015, 0.36]]
        .into_iter()
        .map(|start| {
            let recorder = Recorder { model, calls: Mutex::new(Vec::new()) };
            // A search that does not end is shown as far as it went.
            drop(secant::solve(&recorder, &operating_point(&point), point.ratio, start, &Secant::default()));
            Search { start, calls: recorder.calls.into_inner().unwrap_or_else(PoisonError::into_inner) }
        })
        .collect();
    (point, searches)
}

fn empirical_constant(joint: &Identification) -> f64 {
    let of = |value: fn(&BenchPoint) -> f64| joint.points.iter().map(move |p| value(&p.point));
    let slowest = of(|p| p.n_p_rpm).fold(f64::INFINITY, f64::min);
    let hottest = of(|p| p.t_b_c).fold(f64::NEG_INFINITY, f64::max);
    let [low, high] =
        [of(|p| p.p_h_mpa).fold(f64::INFINITY, f64::min), of(|p| p.p_h_mpa).fold(0.0, f64::max)];
    let chosen: Vec<f64> = joint
        .points
        .iter()
        .filter(|p| {
            let at = &p.point;
            at.n_p_rpm < 1.05 * slowest
                && at.t_b_c > hottest - 5.0
                && (low + 0.15 * (high - low)..=high - 0.15 * (high - low)).contains(&at.p_h_mpa)
        })
        .map(|p| p.kou)
        .collect();
    if chosen.is_empty() { joint.points[0].kou } else { chosen.iter().sum::<f64>() / chosen.len() as f64 }
}

/// The measured value nearest to a wanted one.
pub(super) fn nearest(points: &[BenchPoint], of: fn(&BenchPoint) -> f64, wanted: f64) -> f64 {
    points.iter().map(of).min_by(|a, b| (a - wanted).abs().total_cmp(&(b - wanted).abs())).unwrap_or(wanted)
}

/// Smallest and largest measured value.
pub(super) fn extent(points: &[BenchPoint], of: fn(&BenchPoint) -> f64) -> [f64; 2] {
    let values = points.iter().map(of);
    [values.clone().fold(f64::INFINITY, f64::min), values.fold(f64::NEG_INFINITY, f64::max)]
}
