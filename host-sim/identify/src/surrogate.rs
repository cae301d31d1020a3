//! The surrogate: constants of the reduced model fitted to a better model over an envelope.
//!
//! Five constants are free: leaking chambers and how they fall with speed and with the root of pressure, the flow of
//! bridging grooves, and the pump's dead volume. The ratio is linear in all of them, so the fit is one linear least
//! squares problem, solved by singular values; its columns are differences of the estimator's own forward model.
//! Displacements and oil stay as they are: they belong to the machine. `docs/reduced-model.md` says why these five.

use kou_estimator::model::flow_balance::ReducedConfig;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::envelope::Envelope;
use super::ratio_model::{OperatingPoint, RatioModel, ReducedRatio};
use crate::calibration::{oil_config, reduced_config};
use kou_lumped::machine::Machine;
use kou_records::InputError;

/// Points to which the surrogate is fitted: some twenty for each constant.
pub const POINTS: u32 = 96;

/// A fitted surrogate.
#[derive(Debug, Clone, PartialEq)]
pub struct Surrogate {
    /// Its constants.
    pub config: ReducedConfig,
    /// Mean low pressure of the better model, gauge: the reduced model's where none is measured.
    pub low_pressure_mpa: f64,
    /// Mean magnitude of the error of the ratio over the points of the fit.
    pub ratio_error_mean: f64,
    /// Largest magnitude.
    pub ratio_error_max: f64,
    /// Points used.
    pub points: usize,
}

#[allow(clippy::cast_possible_truncation, reason = "the estimator works in f32")]
const fn single(value: f64) -> f32 {
    value as f32
}

/// The five constants with the step by which each is differentiated. The ratio is linear in them, so steps are as wide
/// as they need to be for f32.
fn constants(k: &mut ReducedConfig) -> [(&mut f32, f32); 5] {
    let displacement = k.pump_displacement.get();
    [
        (&mut k.leaking_chambers, 1.0),
        (&mut k.fewer_leaking_per_rpm, 1e-3),
        (&mut k.fewer_leaking_per_root_mpa, 0.5),
        (&mut k.groove_flow, 3e-4 * displacement),
        (&mut k.pump_dead_volume.0, 0.1 * displacement),
    ]
}

/// Fits the reduced model of `machine` to `model`, which must be of the same machine.
///
/// # Errors
/// A model that fails at most of the points, or constants that the estimator refuses.
pub fn fit(machine: &Machine, model: &dyn RatioModel, envelope: &Envelope) -> Result<Surrogate, InputError> {
    let theory = ReducedRatio::new(machine)?;
    let indices: Vec<u32> = (1..=POINTS).collect();
    let solved: Vec<(OperatingPoint, f64, f64, f64)> = indices
        .into_par_iter()
        .filter_map(|i| {
            let (at, kou) = envelope.point(i, &theory);
            model.solve(&at, kou).ok().map(|s| (at, kou, s.ratio, s.p_l_mpa))
        })
        .collect();
    if solved.len() < POINTS as usize / 2 {
        return Err(InputError::new(format!(
            "the full model has no steady state at {} of {POINTS} points of the envelope",
            POINTS as usize - solved.len()
        )));
    }
    let low_pressure_mpa = solved.iter().map(|s| s.3).sum::<f64>() / solved.len() as f64;
    let oil = oil_config(machine);
    let mut config = reduced_config(machine);
    let ratios = |config: ReducedConfig| -> Result<DVector<f64>, InputError> {
        let reduced = ReducedRatio::with(config, oil, low_pressure_mpa)?;
        Ok(DVector::from_iterator(solved.len(), solved.iter().map(|(at, kou, ..)| reduced.ratio(at, *kou))))
    };
    let wanted = DVector::from_iterator(solved.len(), solved.iter().map(|s| s.2));
    // Twice: the second pass removes what f32 rounding left of the first.
    for _ in 0..2 {
        let base = ratios(config)?;
        let mut columns = DMatrix::zeros(solved.len(), 5);
        let mut steps = [0.0; 5];
        for (j, step_out) in steps.iter_mut().enumerate() {
            let mut stepped = config;
            if let Some((value, step)) = constants(&mut stepped).into_iter().nth(j) {
                *value += step;
                *step_out = f64::from(step);
            }
            columns.set_column(j, &(ratios(stepped)? - &base));
        }
        let solution = columns
            .svd(true, true)
            .solve(&(&wanted - &base), 1e-9)
            .map_err(|e| InputError::new(format!("the surrogate cannot be fitted: {e}")))?;
        for ((value, step), share) in constants(&mut config).into_iter().zip(solution.iter()) {
            *value += single(share * f64::from(step));
        }
    }
    let errors = wanted - ratios(config)?;
    Ok(Surrogate {
        config,
        low_pressure_mpa,
        ratio_error_mean: errors.abs().mean(),
        ratio_error_max: errors.amax(),
        points: solved.len(),
    })
}
