//! Waveforms: pressures, flows and torques sampled while stepping, written as CSV.

use std::f64::consts::TAU;
use std::path::Path;

use crate::error::SimError;
use crate::hydraulics::{MOTOR_LEAKAGE, MOTOR_TO_A, MOTOR_TO_B, PUMP_LEAKAGE, PUMP_TO_A, PUMP_TO_B};
use crate::layout::{CHARGE_GALLERY, FLUSHING_GALLERY, LINE_A, LINE_B};
use crate::oil::ATMOSPHERE_PA;
use crate::plant::Plant;
use crate::plant_state::PlantState;
use crate::simd::WIDTH;
use crate::stepping::StepObserver;

/// Largest number of samples: at a tenth of a degree, about 280 revolutions.
const MAX_SAMPLES: usize = 1_000_000;

/// Recorder of every n-th step.
#[derive(Debug)]
pub struct WaveformRecorder<'a> {
    plant: &'a Plant,
    every: u64,
    steps: u64,
    samples: Vec<WaveformSample>,
}

/// Sample of the waveforms. Pressures are gauge, angles accumulate from the start.
#[derive(Debug, Clone, PartialEq)]
pub struct WaveformSample {
    /// Time.
    pub time_s: f64,
    /// Pump angle.
    pub phi_p_deg: f64,
    /// Motor angle.
    pub phi_m_deg: f64,
    /// Pressures of lines A and B, charge gallery and flushing gallery.
    pub p_node_mpa: [f64; 4],
    /// Flow of the pump into lines A and B, of the motor into A and B, at the line's density.
    pub flow_l_min: [f64; 4],
    /// Leakage of pump and motor to the case, as volume at case pressure.
    pub leakage_l_min: f64,
    /// Torque of the oil on the motor.
    pub torque_m_nm: f64,
    /// Torque of the oil on the pump.
    pub torque_p_nm: f64,
    /// Motor speed.
    pub n_m_rpm: f64,
    /// Displacement fraction.
    pub alpha: f64,
    /// Pressures of the chambers, pump first.
    pub p_chamber_mpa: Vec<f64>,
}

impl<'a> WaveformRecorder<'a> {
    /// Recorder of every `every`-th step.
    #[must_use]
    pub fn new(plant: &'a Plant, every: u64) -> Self {
        Self { plant, every: every.max(1), steps: 0, samples: Vec::new() }
    }

    /// Recorded samples.
    #[must_use]
    pub fn samples(&self) -> &[WaveformSample] {
        &self.samples
    }

    /// Writes CSV with a heading; column names carry the unit.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write_csv(&self, path: &Path) -> Result<(), SimError> {
        let fail = |e: csv::Error| SimError::Output(format!("{}: cannot be written: {e}", path.display()));
        let mut writer = csv::Writer::from_path(path).map_err(fail)?;
        let mut heading: Vec<String> = ["time_s", "phi_p_deg", "phi_m_deg"].map(String::from).to_vec();
        heading.extend((1..=self.plant.pump_pistons).map(|i| format!("p_pump_{i}_mpa")));
        heading.extend((1..=self.plant.motor_pistons).map(|i| format!("p_motor_{i}_mpa")));
        for name in ["p_a_mpa", "p_b_mpa", "p_charge_mpa", "p_flushing_mpa", "flow_pump_a_l_min"] {
            heading.push(name.into());
        }
        for name in ["flow_pump_b_l_min", "flow_motor_a_l_min", "flow_motor_b_l_min", "leakage_l_min"] {
            heading.push(name.into());
        }
        for name in ["torque_m_nm", "torque_p_nm", "n_m_rpm", "alpha"] {
            heading.push(name.into());
        }
        writer.write_record(&heading).map_err(fail)?;
        for sample in &self.samples {
            let values = [sample.time_s, sample.phi_p_deg, sample.phi_m_deg]
                .into_iter()
                .chain(sample.p_chamber_mpa.iter().copied())
                .chain(sample.p_node_mpa)
                .chain(sample.flow_l_min)
                .chain([
                    sample.leakage_l_min,
                    sample.torque_m_nm,
                    sample.torque_p_nm,
                    sample.n_m_rpm,
                    sample.alpha,
                ]);
            writer.write_record(values.map(|x| format!("{x:.9}"))).map_err(fail)?;
        }
        writer.flush().map_err(|e| SimError::Output(format!("{}: cannot be written: {e}", path.display())))
    }
}

impl StepObserver for WaveformRecorder<'_> {
    fn observe(&mut self, state: &PlantState, _h: f64) {
        self.steps += 1;
        if !self.steps.is_multiple_of(self.every) || self.samples.len() >= MAX_SAMPLES {
            return;
        }
        let gauge = |p: f64| (p - ATMOSPHERE_PA) * 1.0e-6;
        let rates = state.flows_kg_s();
        let l_min = |flow: usize, node: usize| {
            rates[flow] * self.plant.node_m3[node] / state.masses.node[node] * 60_000.0
        };
        self.samples.push(WaveformSample {
            time_s: state.time_s,
            phi_p_deg: state.phi_p_rad.to_degrees(),
            phi_m_deg: state.phi_m_rad.to_degrees(),
            p_node_mpa: [LINE_A, LINE_B, CHARGE_GALLERY, FLUSHING_GALLERY].map(|k| gauge(state.p_node_pa[k])),
            flow_l_min: [
                l_min(PUMP_TO_A, LINE_A),
                l_min(PUMP_TO_B, LINE_B),
                l_min(MOTOR_TO_A, LINE_A),
                l_min(MOTOR_TO_B, LINE_B),
            ],
            leakage_l_min: (rates[PUMP_LEAKAGE] + rates[MOTOR_LEAKAGE]) / self.plant.case_rho * 60_000.0,
            torque_m_nm: state.torque_m_nm,
            torque_p_nm: state.torque_p_nm,
            n_m_rpm: state.omega_m_rad_s / TAU * 60.0,
            alpha: state.alpha,
            p_chamber_mpa: (0..self.plant.chambers())
                .map(|i| gauge(state.p_chamber_pa[i / WIDTH].0[i % WIDTH]))
                .collect(),
        });
    }
}
