//! Measured point of the joint fit, with its regressor.

use kou_lumped::OperatingPoint;

use crate::law_fit::{LawFit, normalised, phi};

/// Measured point with its row of the law's terms.
#[derive(Debug, Clone, PartialEq)]
pub struct Observation {
    /// Operating point.
    pub at: OperatingPoint,
    /// Measured ratio.
    pub ratio: f64,
    /// Normalised speed, pressure and temperature.
    pub x: [f64; 3],
    /// Regressor: the determined terms of the law.
    pub phi: Vec<f64>,
}

impl Observation {
    /// Observation of a ratio, with the normalisers and determined terms of a law.
    #[must_use]
    pub fn new(fit: &LawFit, at: OperatingPoint, ratio: f64) -> Self {
        let x = normalised(&fit.law, at.n_p_rpm, at.p_h_mpa, at.t_b_c);
        let all = phi(x);
        Self { at, ratio, x, phi: fit.determined_terms().iter().map(|i| all[*i]).collect() }
    }

    /// Leakage coefficient by the law, whose coefficients are the first of the unknowns.
    #[must_use]
    pub fn kou(&self, unknowns: &[f64]) -> f64 {
        self.phi.iter().zip(unknowns).map(|(f, k)| f * k).sum()
    }
}
