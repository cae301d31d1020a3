//! Linearised model: the reduced model's ratio and its derivatives at the current unknowns, each row divided by its standard
//! error.

use nalgebra::{DMatrix, DVector};

use kou_lumped::OperatingPoint;
use kou_records::InputError;

use crate::discrepancy::{Basis, Discrepancy, Kernel};
use crate::joint::least_squares::LeastSquares;
use crate::joint::observation::Observation;
use crate::joint::prior::Prior;
use crate::plant_model::MachineCorrection;
use crate::reduced_plant::ReducedPlant;

/// Displacement settings closer than this are the same setting.
const SETTING_TOL: f64 = 0.01;
/// Relative step of the finite differences of the reduced model. The model is nearly linear in the differentiated parameters,
/// so a wide step keeps the f32 rounding (6e-8 of the ratio) below 1e-5 of the derivative.
const STEP: f64 = 0.01;

/// Data and model of a joint fit.
#[derive(Clone, Copy)]
pub(super) struct JointProblem<'a> {
    pub(super) rows: &'a [Observation],
    pub(super) reduced: &'a ReducedPlant,
    /// Ratio of the plant model minus that of the reduced model, per row.
    pub(super) correction: &'a [f64],
    pub(super) prior: Prior,
    /// Partial displacement settings, ascending.
    pub(super) settings: &'a [f64],
    /// Number of law terms.
    pub(super) law_terms: usize,
}

/// State of the iteration: unknowns (parameters, then discrepancy coefficients) and robust weights of the rows.
pub(super) struct FitState {
    pub(super) unknowns: Vec<f64>,
    pub(super) weight: Vec<f64>,
}

/// Model linearised at the current unknowns, whitened by each row's standard error.
pub(super) struct LinearisedModel {
    pub(super) jacobian: DMatrix<f64>,
    pub(super) residual: DVector<f64>,
    /// Ratio by the law, without discrepancy.
    pub(super) ratio: Vec<f64>,
    pub(super) slope: Vec<f64>,
    pub(super) sigma: Vec<f64>,
    pub(super) discrepancy: Discrepancy,
}

/// Machine correction of the unknowns: displacement and bulk modulus follow the law terms.
pub(super) fn machine_correction(unknowns: &[f64], law_terms: usize) -> MachineCorrection {
    MachineCorrection { displacement: 1.0 + unknowns[law_terms], bulk: 1.0 + unknowns[law_terms + 1] }
}

/// Index of a row's displacement setting; `None` at full displacement.
fn setting_index(row: &Observation, settings: &[f64]) -> Option<usize> {
    settings.iter().position(|s| (row.at.alpha.abs() - s).abs() < SETTING_TOL)
}

/// Operating point of a row with the identified displacement setting.
pub(super) fn identified_point(row: &Observation, unknowns: &[f64], settings: &[f64]) -> OperatingPoint {
    let first = unknowns.len() - settings.len();
    let factor = setting_index(row, settings).map_or(1.0, |i| 1.0 + unknowns[first + i]);
    OperatingPoint { alpha: row.at.alpha * factor, ..row.at }
}

/// Partial displacement settings of the rows, ascending.
pub(super) fn partial_settings(rows: &[Observation]) -> Vec<f64> {
    let mut all: Vec<f64> =
        rows.iter().map(|r| r.at.alpha.abs()).filter(|a| *a < 1.0 - SETTING_TOL).collect();
    all.sort_by(f64::total_cmp);
    all.dedup_by(|a, b| (*a - *b).abs() < SETTING_TOL);
    all
}

impl JointProblem<'_> {
    /// Number of parameters: law terms, displacement, bulk modulus and settings; discrepancy coefficients follow.
    pub(super) fn parameters(&self) -> usize {
        self.law_terms + 2 + self.settings.len()
    }

    /// Prior standard errors of the first `count` unknowns; infinite for the law.
    pub(super) fn prior_se(&self, count: usize) -> Vec<f64> {
        let mut all = vec![f64::INFINITY; self.law_terms];
        all.extend([self.prior.displacement, self.prior.bulk]);
        all.extend(self.settings.iter().map(|_| self.prior.setting));
        // Discrepancy coefficients have unit variance.
        all.resize(count.max(all.len()), 1.0);
        all
    }

    /// Least-squares problem of one Gauss-Newton step.
    pub(super) fn least_squares(&self, linear: &LinearisedModel, state: &FitState) -> LeastSquares {
        let prior_se = self.prior_se(state.unknowns.len());
        LeastSquares::new(&linear.jacobian, &linear.residual, &state.weight, &state.unknowns, &prior_se)
    }

    /// Linearises the model at these unknowns, with a discrepancy of this basis and kernel.
    pub(super) fn linearise(
        &self,
        unknowns: &[f64],
        basis: &Basis,
        kernel: Kernel,
    ) -> Result<LinearisedModel, InputError> {
        let (parameters, discrepancy_coefficients) = unknowns.split_at(self.parameters());
        let kou: Vec<f64> = self.rows.iter().map(|row| row.kou(parameters)).collect();
        let terms: Vec<&[f64]> = self.rows.iter().map(|r| r.phi.as_slice()).collect();
        let points: Vec<[f64; 3]> = self.rows.iter().map(|r| r.x).collect();
        let discrepancy = Discrepancy::new(basis.clone(), kernel.sigma, &points, &terms, &kou);
        let current = machine_correction(parameters, self.law_terms);
        let model = self.reduced.with_correction(current)?;
        let with = |correction: MachineCorrection| self.reduced.with_correction(correction);
        let by_displacement = [
            with(MachineCorrection { displacement: current.displacement + STEP, ..current })?,
            with(MachineCorrection { displacement: current.displacement - STEP, ..current })?,
        ];
        let by_bulk = [
            with(MachineCorrection { bulk: current.bulk + STEP, ..current })?,
            with(MachineCorrection { bulk: current.bulk - STEP, ..current })?,
        ];
        let (n, count) = (self.rows.len(), unknowns.len());
        let mut linear = LinearisedModel {
            jacobian: DMatrix::zeros(n, count),
            residual: DVector::zeros(n),
            ratio: Vec::with_capacity(n),
            slope: Vec::with_capacity(n),
            sigma: Vec::with_capacity(n),
            discrepancy,
        };
        for (i, (row, correction)) in self.rows.iter().zip(self.correction).enumerate() {
            let at = identified_point(row, parameters, self.settings);
            let kou = kou[i];
            let slope = model.slope(&at) * at.alpha.signum();
            let ratio = model.ratio(&at, kou) + correction;
            let central =
                |pair: &[ReducedPlant; 2]| (pair[0].ratio(&at, kou) - pair[1].ratio(&at, kou)) / (2.0 * STEP);
            let per_mpa = {
                let higher = OperatingPoint { p_h_mpa: at.p_h_mpa * (1.0 + STEP), ..at };
                (model.ratio(&higher, kou) - model.ratio(&at, kou)) / (at.p_h_mpa * STEP)
            };
            let discrepancy = linear.discrepancy.at(&row.x, &row.phi, kou);
            let sigma = (self.prior.ratio * row.ratio)
                .hypot(self.prior.pressure_mpa * per_mpa)
                .hypot(self.prior.misfit * kou.max(0.0) * slope)
                .hypot(discrepancy.remainder * slope)
                .max(1e-6);
            for (j, f) in row.phi.iter().enumerate() {
                linear.jacobian[(i, j)] = slope * f / sigma;
            }
            let d = self.law_terms;
            linear.jacobian[(i, d)] = central(&by_displacement) / sigma;
            linear.jacobian[(i, d + 1)] = central(&by_bulk) / sigma;
            if let Some(setting) = setting_index(row, self.settings) {
                let wider = OperatingPoint { alpha: at.alpha + row.at.alpha * STEP, ..at };
                let narrower = OperatingPoint { alpha: at.alpha - row.at.alpha * STEP, ..at };
                let per = (model.ratio(&wider, kou) - model.ratio(&narrower, kou)) / (2.0 * STEP);
                linear.jacobian[(i, d + 2 + setting)] = per / sigma;
            }
            let mut by_discrepancy = 0.0;
            for (j, (f, coefficient)) in discrepancy.kou.iter().zip(discrepancy_coefficients).enumerate() {
                linear.jacobian[(i, parameters.len() + j)] = slope * f / sigma;
                by_discrepancy += slope * f * coefficient;
            }
            linear.residual[i] = (row.ratio - ratio - by_discrepancy) / sigma;
            linear.ratio.push(ratio);
            linear.slope.push(slope);
            linear.sigma.push(sigma);
        }
        Ok(linear)
    }
}
