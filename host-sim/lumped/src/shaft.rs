//! Shafts: drive of the pump, load and friction of the motor, and the swash actuator.
//!
//! Torques of the oil: tau = sum_i (p_i - p_c) * dV_i/dphi, positive along positive rotation; a motor is driven by it,
//! a pump braked. Constant friction and a resistive load oppose motion and hold a shaft at rest up to their size; they
//! act as an impulse that can stop the shaft but never turn it back (time stepping after Moreau), so no artificial
//! speed at which friction "switches" is needed.

use crate::machine::{ShaftFriction, SwashActuator};

/// Load on the motor's shaft.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ShaftLoad {
    /// Opposes motion with up to this torque; holds at rest, cannot drive backwards.
    ResistiveNm(f64),
    /// Constant torque against positive rotation; negative values drive the motor (overrunning).
    ConstantNm(f64),
    /// The speed is imposed, rad/s, whatever the torque.
    SpeedRadS(f64),
}

/// What turns the pump.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ShaftDrive {
    /// Speed imposed, rad/s.
    SpeedRadS(f64),
    /// Engine with a governor: torque in proportion to the lag behind `set_rad_s`, between 0 and `limit_nm`, on the
    /// pump's inertia.
    Governed {
        /// Speed at which the governor asks for no torque.
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
