//! Prior standard errors of the machine parameters and random errors of the measurements.

/// Standard errors known before the fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prior {
    /// Relative standard error of the displacement ratio: tolerance of the machine file and systematic error of both speed
    /// sensors.
    pub displacement: f64,
    /// Relative standard error of the machine file's bulk modulus.
    pub bulk: f64,
    /// Relative standard error of each displacement setting below full.
    pub setting: f64,
    /// Relative random error of a measured ratio.
    pub ratio: f64,
    /// Random error of a measured pressure.
    pub pressure_mpa: f64,
    /// Relative misfit of law and smooth discrepancy together: a lower bound of the error of every point.
    pub misfit: f64,
}

impl Default for Prior {
    fn default() -> Self {
        Self { displacement: 0.02, bulk: 0.1, setting: 0.05, ratio: 3e-4, pressure_mpa: 0.03, misfit: 0.003 }
    }
}
