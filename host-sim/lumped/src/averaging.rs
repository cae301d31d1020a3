//! Smooth averages and peak-to-peak values over a window of steps.
//!
//! The window (a low-pass filter of finite length) is a box convolved with the bump 8/3*sin^4: it rises over `edge`, is
//! flat, and falls over `edge`,
//!
//! ```text
//! w(t) = (S(t/edge) - S((t - box)/edge)) / box        S(x) = x - 2/(3 pi) sin(2 pi x) + 1/(12 pi) sin(4 pi x)
//! ```
//!
//! so a disturbance of exactly the box's length, the beat of pump and motor, vanishes from the mean, and piston ripple
//! that fits the edge n times keeps 4/(pi n^5) of its amplitude. Nothing here feeds back into the model.

use crate::hydraulics::FLOWS;
use crate::layout::{LINE_A, LINE_B, NODES};
use crate::plant_state::PlantState;
use crate::stepping::StepObserver;

/// Shape of an averaging window: lengths in steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WindowShape {
    /// Flat part, between the middles of the edges; need not be an integer.
    pub box_steps: f64,
    /// Rising or falling part.
    pub edge_steps: f64,
}

impl WindowShape {
    /// Steps of the window.
    #[must_use]
    pub fn steps(&self) -> u64 {
        (self.box_steps + self.edge_steps).ceil() as u64
    }

    /// Weight at `t` steps after the window's start, per step.
    #[inline]
    fn weight(&self, t: f64) -> f64 {
        let rise = |t: f64| {
            let x = (t / self.edge_steps).clamp(0.0, 1.0);
            let (sin, cos) = (std::f64::consts::TAU * x).sin_cos();
            x - sin * (2.0 / 3.0 - cos / 6.0) / std::f64::consts::PI
        };
        (rise(t) - rise(t - self.box_steps)) / self.box_steps
    }
}

/// Weighted averages over one window.
#[derive(Debug, Clone)]
pub struct AveragingWindow {
    shape: WindowShape,
    steps: u64,
    last_node_kg: [f64; NODES],
    last_flow_kg: [f64; FLOWS],
    means: WindowMeans,
    lowest_pa: [f64; 2],
    highest_pa: [f64; 2],
    omega_p: f64,
    omega_m: f64,
}

/// Weighted means of a window.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct WindowMeans {
    /// Absolute node pressures, Pa.
    pub p_node_pa: [f64; NODES],
    /// Rates of the nodes' masses, kg/s.
    pub node_kg_s: [f64; NODES],
    /// Flows, kg/s.
    pub flow_kg_s: [f64; FLOWS],
    /// Torque of the oil on the pump.
    pub torque_p_nm: f64,
    /// Torque of the oil on the motor.
    pub torque_m_nm: f64,
    /// Pump speed.
    pub omega_p_rad_s: f64,
    /// Motor speed.
    pub omega_m_rad_s: f64,
}

impl WindowMeans {
    /// Adds another window's means with a weight.
    pub fn add(&mut self, other: &WindowMeans, weight: f64) {
        for (x, y) in self.p_node_pa.iter_mut().zip(other.p_node_pa) {
            *x += weight * y;
        }
        for (x, y) in self.node_kg_s.iter_mut().zip(other.node_kg_s) {
            *x += weight * y;
        }
        for (x, y) in self.flow_kg_s.iter_mut().zip(other.flow_kg_s) {
            *x += weight * y;
        }
        self.torque_p_nm += weight * other.torque_p_nm;
        self.torque_m_nm += weight * other.torque_m_nm;
        self.omega_p_rad_s += weight * other.omega_p_rad_s;
        self.omega_m_rad_s += weight * other.omega_m_rad_s;
    }
}

impl AveragingWindow {
    /// Window that begins at `state`.
    #[must_use]
    pub fn new(state: &PlantState, shape: WindowShape) -> Self {
        Self {
            shape,
            steps: 0,
            last_node_kg: state.masses.node,
            last_flow_kg: state.masses.flow,
            means: WindowMeans::default(),
            lowest_pa: [f64::INFINITY; 2],
            highest_pa: [f64::NEG_INFINITY; 2],
            omega_p: state.omega_p_rad_s,
            omega_m: state.omega_m_rad_s,
        }
    }

    /// Means so far; complete after all steps of the window.
    #[must_use]
    pub fn means(&self) -> WindowMeans {
        self.means
    }

    /// Peak-to-peak pressure of line A and line B.
    #[must_use]
    pub fn ripple_pa(&self) -> [f64; 2] {
        [self.highest_pa[LINE_A] - self.lowest_pa[LINE_A], self.highest_pa[LINE_B] - self.lowest_pa[LINE_B]]
    }
}

impl StepObserver for AveragingWindow {
    #[inline(always)]
    fn observe(&mut self, state: &PlantState, h: f64) {
        // Weight at the middle of the step for what changed over it, at its end for what is sampled there.
        let w = self.shape.weight(self.steps as f64 + 0.5);
        let at_end = self.shape.weight(self.steps as f64 + 1.0);
        let rate = w / h;
        let m = &mut self.means;
        for k in 0..NODES {
            m.p_node_pa[k] += at_end * state.p_node_pa[k];
            m.node_kg_s[k] += rate * (state.masses.node[k] - self.last_node_kg[k]);
        }
        for k in 0..FLOWS {
            m.flow_kg_s[k] += rate * (state.masses.flow[k] - self.last_flow_kg[k]);
        }
        m.torque_p_nm += at_end * state.torque_p_nm;
        m.torque_m_nm += at_end * state.torque_m_nm;
        m.omega_p_rad_s += w * 0.5 * (self.omega_p + state.omega_p_rad_s);
        m.omega_m_rad_s += w * 0.5 * (self.omega_m + state.omega_m_rad_s);
        self.omega_p = state.omega_p_rad_s;
        self.omega_m = state.omega_m_rad_s;
        self.last_node_kg = state.masses.node;
        self.last_flow_kg = state.masses.flow;
        for k in [LINE_A, LINE_B] {
            self.lowest_pa[k] = self.lowest_pa[k].min(state.p_node_pa[k]);
            self.highest_pa[k] = self.highest_pa[k].max(state.p_node_pa[k]);
        }
        self.steps += 1;
    }
}
