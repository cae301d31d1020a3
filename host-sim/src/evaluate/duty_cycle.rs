//! Duty cycle of a vehicle: plateaus of some seconds with ramps between them, idling, warming up and cooling down.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// Sample period of a simulated drive, s: a block of health monitoring then holds ten samples, one for each of its stages.
pub const PERIOD_S: f64 = 0.05;

/// Operating point of a duty cycle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DutyPoint {
    /// Pump speed.
    pub n_p_rpm: f64,
    /// High pressure, gauge.
    pub p_h_mpa: f64,
    /// Oil temperature.
    pub t_b_c: f64,
    /// Displacement.
    pub alpha: f64,
}

/// Generator of operating points.
#[derive(Debug, Clone)]
pub struct DutyCycle {
    rng: ChaCha8Rng,
    limits: [f64; 3],
    from: DutyPoint,
    to: DutyPoint,
    ramp_s: f64,
    hold_s: f64,
    at_s: f64,
    ambient_c: f64,
    oil_c: f64,
}

fn uniform(rng: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * (f64::from(rng.next_u32()) / f64::from(u32::MAX))
}

impl DutyCycle {
    /// A duty cycle within `limits`: largest speed, pressure and temperature.
    #[must_use]
    pub fn new(seed: u64, limits: [f64; 3]) -> Self {
        let [n_max, ..] = limits;
        let idle = DutyPoint { n_p_rpm: 0.36 * n_max, p_h_mpa: 1.6, t_b_c: 40.0, alpha: 0.0 };
        Self {
            rng: ChaCha8Rng::seed_from_u64(seed),
            limits,
            from: idle,
            to: idle,
            ramp_s: 1.0,
            hold_s: 5.0,
            at_s: 0.0,
            ambient_c: 55.0,
            oil_c: 38.0,
        }
    }

    /// The next operating point, one period later.
    pub fn advance(&mut self) -> DutyPoint {
        self.at_s += PERIOD_S;
        if self.at_s > self.ramp_s + self.hold_s {
            self.at_s = 0.0;
            self.from = self.to;
            self.to = self.target();
            self.ramp_s = uniform(&mut self.rng, 0.4, 3.0);
            self.hold_s = uniform(&mut self.rng, 2.0, 18.0);
            // Every few minutes the load, and with it the temperature that the oil tends to, changes.
            if self.rng.next_u32().is_multiple_of(20) {
                let [.., t_max] = self.limits;
                self.ambient_c = uniform(&mut self.rng, 0.45 * t_max, 0.97 * t_max);
            }
        }
        self.oil_c += (self.ambient_c - self.oil_c) * PERIOD_S / 400.0;
        let share = (self.at_s / self.ramp_s).min(1.0);
        let between = |a: f64, b: f64| a + (b - a) * share;
        DutyPoint {
            n_p_rpm: between(self.from.n_p_rpm, self.to.n_p_rpm),
            p_h_mpa: between(self.from.p_h_mpa, self.to.p_h_mpa),
            t_b_c: self.oil_c,
            alpha: between(self.from.alpha, self.to.alpha),
        }
    }

    fn target(&mut self) -> DutyPoint {
        let [n_max, p_max, _] = self.limits;
        let rng = &mut self.rng;
        if rng.next_u32().is_multiple_of(12) {
            return DutyPoint { n_p_rpm: 0.36 * n_max, p_h_mpa: 1.6, t_b_c: 0.0, alpha: 0.0 };
        }
        let alpha = match rng.next_u32() % 10 {
            0..6 => 1.0,
            6 | 7 => uniform(rng, 0.35, 0.95),
            _ => -uniform(rng, 0.35, 1.0),
        };
        // Middle loads are commonest: a mean of two uniform values.
        let load = 0.5 * (uniform(rng, 0.22, 0.9) + uniform(rng, 0.22, 0.9));
        DutyPoint { n_p_rpm: uniform(rng, 0.4, 0.97) * n_max, p_h_mpa: load * p_max, t_b_c: 0.0, alpha }
    }
}
