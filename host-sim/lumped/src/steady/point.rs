//! Steady state of the drive as the solver reports it.

/// Steady state: speed ratio, pressures, torques, leakage and the solver's residual.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct SteadyPoint {
    /// Speed ratio n_m/n_p.
    pub ratio: f64,
    /// Uncertainty of the ratio: last change of its running mean, or the remainder of the last correction.
    pub residual: f64,
    /// Mean high pressure, gauge.
    pub p_h_mpa: f64,
    /// Mean low pressure, gauge.
    pub p_l_mpa: f64,
    /// Mean torque of the oil on the motor, friction not subtracted.
    pub torque_nm: f64,
    /// Mean torque of the oil against the pump's shaft.
    pub pump_torque_nm: f64,
    /// Leakage of all chambers, as volume at case pressure.
    pub leakage_l_min: f64,
    /// Peak to peak of the high pressure.
    pub ripple_p_h_mpa: f64,
    /// |inflow - outflow - change of stored mass| over pumped mass, largest of all windows.
    pub mass_balance_error: f64,
    /// Simulated time, all runs together.
    pub sim_seconds: f64,
    /// Pump revolutions simulated, all runs together.
    pub revolutions: f64,
}
