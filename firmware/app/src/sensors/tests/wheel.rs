//! Simulated toothed wheel: speed over time in, edges out, with configurable defects and noise.

use std::vec::Vec;

/// Counts of the stamping timer per second.
pub const COUNTER_HZ: f64 = 10e6;

/// Rotating wheel.
#[derive(Debug, Clone)]
pub struct Wheel {
    pub teeth: u32,
    /// Missing teeth at the end of each revolution.
    pub gap: u32,
    /// Timer count at time zero: edges are stamped by a timer that wraps.
    pub offset: u32,
    revolutions: f64,
    time_s: f64,
    next_tooth: u64,
}

impl Wheel {
    pub fn new(teeth: u32, gap: u32, offset: u32) -> Self {
        Self { teeth, gap, offset, revolutions: 0.0, time_s: 0.0, next_tooth: 1 }
    }

    /// Rotates for a millisecond, from one speed to another, and returns the times of its edges in seconds.
    pub fn millisecond(&mut self, from_rpm: f64, to_rpm: f64) -> Vec<f64> {
        let (dt, a) = (1e-3, (to_rpm - from_rpm) / 60.0 / 1e-3);
        let w = from_rpm / 60.0;
        let end = self.revolutions + (w + 0.5 * a * dt) * dt;
        let mut edges = Vec::new();
        loop {
            let at_revolutions = self.next_tooth as f64 / f64::from(self.teeth);
            if at_revolutions > end {
                break;
            }
            let way = at_revolutions - self.revolutions;
            // Root of w t + a t^2/2 = way in the form without cancellation.
            let t = 2.0 * way / (w + (w * w + 2.0 * a * way).max(0.0).sqrt()).max(1e-12);
            if self.next_tooth % u64::from(self.teeth) >= u64::from(self.gap) {
                edges.push(self.time_s + t.clamp(0.0, dt));
            }
            self.next_tooth += 1;
        }
        self.revolutions = end;
        self.time_s += dt;
        edges
    }

    /// Time as a timer count.
    pub fn stamp(&self, time_s: f64) -> u32 {
        self.offset.wrapping_add((time_s * COUNTER_HZ) as u64 as u32)
    }

    pub fn time_s(&self) -> f64 {
        self.time_s
    }
}
