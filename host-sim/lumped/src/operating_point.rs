//! Steady operating point of a drive: shaft speed, line pressures, oil temperature and displacement.

/// Steady operating point as a bench sets and measures it; pressures are gauge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OperatingPoint {
    /// Pump speed.
    pub n_p_rpm: f64,
    /// High pressure.
    pub p_h_mpa: f64,
    /// Low pressure; `None` where it was not measured. The lumped model computes it from the charge circuit.
    pub p_l_mpa: Option<f64>,
    /// Oil temperature.
    pub t_b_c: f64,
    /// Displacement fraction of the pump.
    pub alpha: f64,
}
