//! The reduced model's ratio and its derivatives about the present unknowns, each row over its standard error.

use nalgebra::{DMatrix, DVector};

use super::{OperatingPoint, Prior, Row};
use crate::discrepancy::{Basis, Discrepancy, Shape};
use crate::ratio_model::{Change, ReducedRatio};
use kou_records::InputError;

/// Settings closer than this are one setting of one stop or lever.
const SAME_SETTING: f64 = 0.01;
/// Steps of the differences by which the reduced model is differentiated. It works in f32, 6e-8 of ratio, and is nearly
/// linear in all three, so wide steps cost nothing and keep rounding below 1e-5 of the derivative.
const STEP: f64 = 0.01;

/// What is fitted to what.
#[derive(Clone, Copy)]
pub(super) struct Problem<'a> {
    pub(super) rows: &'a [Row],
    pub(super) reduced: &'a ReducedRatio,
    pub(super) correction: &'a [f64],
    pub(super) prior: Prior,
    pub(super) settings: &'a [f64],
    pub(super) kept: usize,
}

/// The model about the present unknowns, whitened by each row's standard error.
pub(super) struct Linear {
    pub(super) jacobian: DMatrix<f64>,
    pub(super) residual: DVector<f64>,
    /// By the law, without the functions beside it.
    pub(super) ratio: Vec<f64>,
    pub(super) slope: Vec<f64>,
    pub(super) sigma: Vec<f64>,
    pub(super) discrepancy: Discrepancy,
}

/// Index of the displacement among the unknowns behind `kept` law terms; bulk modulus and settings follow.
const fn displacement_index(kept: usize) -> usize {
    kept
}

pub(super) fn change(unknowns: &[f64], kept: usize) -> Change {
    let d = displacement_index(kept);
    Change { displacement: 1.0 + unknowns[d], bulk: 1.0 + unknowns[d + 1] }
}

pub(super) fn setting_of(row: &Row, settings: &[f64]) -> Option<usize> {
    settings.iter().position(|s| (row.at.alpha.abs() - s).abs() < SAME_SETTING)
}

pub(super) fn settled(row: &Row, unknowns: &[f64], settings: &[f64]) -> OperatingPoint {
    let first = unknowns.len() - settings.len();
    let factor = setting_of(row, settings).map_or(1.0, |i| 1.0 + unknowns[first + i]);
    OperatingPoint { alpha: row.at.alpha * factor, ..row.at }
}

/// Partial displacement settings among the rows, ascending.
pub(super) fn settings_of(rows: &[Row]) -> Vec<f64> {
    let mut all: Vec<f64> =
        rows.iter().map(|r| r.at.alpha.abs()).filter(|a| *a < 1.0 - SAME_SETTING).collect();
    all.sort_by(f64::total_cmp);
    all.dedup_by(|a, b| (*a - *b).abs() < SAME_SETTING);
    all
}

impl Problem<'_> {
    pub(super) fn named(&self) -> usize {
        self.kept + 2 + self.settings.len()
    }

    /// Prior standard errors of the first `count` unknowns.
    pub(super) fn prior_se(&self, count: usize) -> Vec<f64> {
        let mut all = vec![f64::INFINITY; self.kept];
        all.extend([self.prior.displacement, self.prior.bulk]);
        all.extend(self.settings.iter().map(|_| self.prior.setting));
        // The functions beside the law are made for coefficients of unit variance.
        all.resize(count.max(all.len()), 1.0);
        all
    }

    /// The model about these unknowns, with that function beside the law.
    pub(super) fn linearise(
        &self,
        unknowns: &[f64],
        basis: &Basis,
        shape: Shape,
    ) -> Result<Linear, InputError> {
        let (named, beside) = unknowns.split_at(self.named());
        let law = |row: &Row| -> f64 { row.phi.iter().zip(named).map(|(f, k)| f * k).sum() };
        let kou: Vec<f64> = self.rows.iter().map(law).collect();
        let terms: Vec<&[f64]> = self.rows.iter().map(|r| r.phi.as_slice()).collect();
        let points: Vec<[f64; 3]> = self.rows.iter().map(|r| r.x).collect();
        let discrepancy = Discrepancy::new(basis.clone(), shape.size, &points, &terms, &kou);
        let now = change(named, self.kept);
        let model = self.reduced.with_change(now)?;
        let with = |change: Change| self.reduced.with_change(change);
        let displaced = [
            with(Change { displacement: now.displacement + STEP, ..now })?,
            with(Change { displacement: now.displacement - STEP, ..now })?,
        ];
        let softened =
            [with(Change { bulk: now.bulk + STEP, ..now })?, with(Change { bulk: now.bulk - STEP, ..now })?];
        let (n, count) = (self.rows.len(), unknowns.len());
        let mut linear = Linear {
            jacobian: DMatrix::zeros(n, count),
            residual: DVector::zeros(n),
            ratio: Vec::with_capacity(n),
            slope: Vec::with_capacity(n),
            sigma: Vec::with_capacity(n),
            discrepancy,
        };
        for (i, (row, correction)) in self.rows.iter().zip(self.correction).enumerate() {
            let at = settled(row, named, self.settings);
            let kou = kou[i];
            let slope = model.slope(&at) * at.alpha.signum();
            let ratio = model.ratio(&at, kou) + correction;
            let central =
                |pair: &[ReducedRatio; 2]| (pair[0].ratio(&at, kou) - pair[1].ratio(&at, kou)) / (2.0 * STEP);
            let per_mpa = {
                let higher = OperatingPoint { p_h_mpa: at.p_h_mpa * (1.0 + STEP), ..at };
                (model.ratio(&higher, kou) - model.ratio(&at, kou)) / (at.p_h_mpa * STEP)
            };
            let functions = linear.discrepancy.at(&row.x, &row.phi, kou);
            let sigma = (self.prior.ratio * row.ratio)
                .hypot(self.prior.pressure_mpa * per_mpa)
                .hypot(self.prior.misfit * kou.max(0.0) * slope)
                .hypot(functions.left * slope)
                .max(1e-6);
            for (j, f) in row.phi.iter().enumerate() {
                linear.jacobian[(i, j)] = slope * f / sigma;
            }
            let d = displacement_index(self.kept);
            linear.jacobian[(i, d)] = central(&displaced) / sigma;
            linear.jacobian[(i, d + 1)] = central(&softened) / sigma;
            if let Some(setting) = setting_of(row, self.settings) {
                let wider = OperatingPoint { alpha: at.alpha + row.at.alpha * STEP, ..at };
                let narrower = OperatingPoint { alpha: at.alpha - row.at.alpha * STEP, ..at };
                let per = (model.ratio(&wider, kou) - model.ratio(&narrower, kou)) / (2.0 * STEP);
                linear.jacobian[(i, d + 2 + setting)] = per / sigma;
            }
            let mut missed = 0.0;
            for (j, (f, coefficient)) in functions.kou.iter().zip(beside).enumerate() {
                linear.jacobian[(i, named.len() + j)] = slope * f / sigma;
                missed += slope * f * coefficient;
            }
            linear.residual[i] = (row.ratio - ratio - missed) / sigma;
            linear.ratio.push(ratio);
            linear.slope.push(slope);
            linear.sigma.push(sigma);
        }
        Ok(linear)
    }
}
