//! Report of a closed loop, as its JSON states it.

use serde::Serialize;

use super::calibration_in_use::LawFinding;
use super::can_bus::BusTraffic;
use super::outage::OutageFinding;
use super::scenario_check::ExpectationFinding;
use super::service_tool::UpdateFinding;

/// Results of a closed loop.
#[derive(Debug, Clone, Serialize)]
pub struct LoopReport {
    /// Name of the scenario.
    pub scenario: String,
    /// Simulated time, s.
    pub simulated_s: f64,
    /// Simulated over real time.
    pub real_time_factor: f64,
    /// Outputs of the firmware.
    pub outputs: u64,
    /// Outputs with a valid observed coefficient.
    pub valid: u64,
    /// CRC-32 over all outputs: the same for the same scenario, machine, calibration and firmware.
    pub outputs_crc32: u32,
    /// Expectations and the observed states.
    pub findings: Vec<ExpectationFinding>,
    /// Failures of the supply, and the state found afterwards.
    pub outages: Vec<OutageFinding>,
    /// Calibration updates and their results.
    pub updates: Vec<UpdateFinding>,
    /// Calibration with which the outputs were computed.
    pub law: LawFinding,
    /// Trouble codes in flash at the end, and how often each occurred.
    #[serde(rename = "troubles")]
    pub faults: Vec<(String, u8)>,
    /// Pages of flash erased.
    pub erasures: u64,
    /// Traffic on the bus.
    pub bus: BusTraffic,
    /// Missed deadlines of all tasks.
    pub missed_deadlines: u64,
    /// Largest start jitter of any task, us.
    #[serde(rename = "latest_us")]
    pub max_jitter_us: u32,
    /// Longest cycle of each task, us: sample, estimate, publish, store, supervise.
    #[serde(rename = "longest_us")]
    pub max_execution_us: [u32; 5],
    /// Cycles of each task since the last start.
    #[serde(rename = "turns")]
    pub cycles: [u32; 5],
    /// Deepest stack, bytes.
    pub stack_bytes: u32,
    /// Whether every expectation is met, no stored record is lost, every update ends as specified, no deadline is missed, and
    /// the firmware ended on request.
    pub passed: bool,
}
