//! Shafts: drive of the pump, load and friction of the motor, swash actuator.
//!
//! Torque of the oil: tau = sum_i (p_i - p_c) * dV_i/dphi, positive in the direction of positive rotation; it drives a
//! motor and brakes a pump. Coulomb friction and a resistive load oppose motion and hold a shaft at rest up to their
//! size; they act as an impulse that can stop the shaft but never reverse it (time stepping after Moreau 1988), so no
//! regularising speed is needed.

use crate::machine::{ShaftFriction, SwashActuator};

/// Load on the motor's shaft.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ShaftLoad {
    /// Opposes motion with up to this torque; holds at rest, cannot drive backwards.
    ResistiveNm(f64),
    /// Constant torque against positive rotation; negative values drive the motor (overrunning).
    ConstantNm(f64),
    /// Imposed speed, rad/s, whatever the torque.
    SpeedRadS(f64),
}

/// Drive of the pump's shaft.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ShaftDrive {
    /// Imposed speed, rad/s.
    SpeedRadS(f64),
    /// Engine with a governor: torque in proportion to the lag behind `set_rad_s`, between 0 and `limit_nm`, on the
    /// pump's inertia.
    Governed {
        /// Speed at which the governor demands no torque.
        set_rad_s: f64,
        /// Governor's gain.
        nm_s: f64,
        /// Largest torque of the engine.
        limit_nm: f64,
    },
}

/// Speed after `dt` of a shaft with inertia `j`, driven by `torque`, against `resisting` (a size) and viscous friction.
///
/// ```text
/// free  = omega + dt/J * (tau - viscous*omega)
/// omega = free - sign(free) * min(|free|, dt/J * resisting)
/// ```
#[inline]
#[must_use]
pub fn kick(omega: f64, dt: f64, j: f64, torque: f64, friction: ShaftFriction, resisting: f64) -> f64 {
    let free = omega + dt / j * (torque - friction.viscous_nm_s * omega);
    let stop = dt / j * (resisting + friction.coulomb_nm);
    free - free.signum() * free.abs().min(stop)
}

/// Displacement fraction after `dt`: first-order lag towards `command`, rate limited.
///
/// alpha = alpha + clamp((command - alpha)*(1 - exp(-dt/T)), -rate*dt, rate*dt)
#[inline]
#[must_use]
pub fn swash(alpha: f64, command: f64, dt: f64, actuator: SwashActuator) -> f64 {
    let away = command - alpha;
    let lag =
        if actuator.time_constant_s > 0.0 { away * -(-dt / actuator.time_constant_s).exp_m1() } else { away };
    let limit = actuator.rate_per_s * dt;
    alpha + lag.clamp(-limit, limit)
}
