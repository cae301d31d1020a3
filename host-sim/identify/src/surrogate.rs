//! Surrogate: constants of the reduced model fitted to a plant model over an envelope.
//!
//! Five constants are free: leaking chambers, their decrease with speed and with the root of pressure, the flow of bridging
//! grooves, and the pump's dead volume. The ratio is linear in all of them, so the fit is a linear least-squares problem,
//! solved by singular value decomposition; its columns are differences of the estimator's own forward model. Displacements
//! and oil are machine parameters and stay fixed. Choice of the constants: `docs/reduced-model.md`.

use kou_estimator::model::flow_balance::ReducedConfig;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use kou_lumped::OperatingPoint;
use kou_records::InputError;

use crate::convert::single;
use crate::envelope::Envelope;
use crate::machine_parameters::MachineParameters;
use crate::plant_model::PlantModel;
use crate::reduced_plant::ReducedPlant;

/// Number of points of the fit: about twenty for each constant.
pub const POINTS: u32 = 96;

/// Fitted surrogate.
#[derive(Debug, Clone, PartialEq)]
pub struct Surrogate {
    /// Constants of the reduced model.
    pub config: ReducedConfig,
    /// Mean low pressure of the plant model, gauge; for the reduced model where none is measured.
    pub low_pressure_mpa: f64,
    /// Mean absolute error of the ratio over the points of the fit.
    pub ratio_error_mean: f64,
    /// Maximum absolute error.
    pub ratio_error_max: f64,
    /// Number of points used.
    pub points: usize,
}

/// The five constants with their difference steps. The ratio is linear in them, so the steps can be wide enough for f32.
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

/// Fits the reduced model of `machine` to a plant model of the same machine.
///
/// # Errors
/// A model that fails at more than half of the points, or constants rejected by the estimator.
pub fn fit(
    machine: &MachineParameters,
    model: &dyn PlantModel,
    envelope: &Envelope,
) -> Result<Surrogate, InputError> {
    let theory = ReducedPlant::new(machine)?;
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
            "the plant model has no steady state at {} of {POINTS} points of the envelope",
            POINTS as usize - solved.len()
        )));
    }
    let low_pressure_mpa = solved.iter().map(|s| s.3).sum::<f64>() / solved.len() as f64;
    let oil = machine.oil_config();
    let mut config = machine.reduced_config();
    let ratios = |config: ReducedConfig| -> Result<DVector<f64>, InputError> {
        let reduced = ReducedPlant::with(config, oil, low_pressure_mpa)?;
        Ok(DVector::from_iterator(solved.len(), solved.iter().map(|(at, kou, ..)| reduced.ratio(at, *kou))))
    };
    let reference = DVector::from_iterator(solved.len(), solved.iter().map(|s| s.2));
    // The second pass removes the f32 rounding errors of the first.
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
            .solve(&(&reference - &base), 1e-9)
            .map_err(|e| InputError::new(format!("the surrogate cannot be fitted: {e}")))?;
        for ((value, step), share) in constants(&mut config).into_iter().zip(solution.iter()) {
            *value += single(share * f64::from(step));
        }
    }
    let errors = reference - ratios(config)?;
    Ok(Surrogate {
        config,
        low_pressure_mpa,
        ratio_error_mean: errors.abs().mean(),
        ratio_error_max: errors.amax(),
        points: solved.len(),
    })
}
