//! The closed loop: a simulated vehicle around the controller's firmware in QEMU.
//!
//! ```text
//! scenario --> vehicle (full model) --> parts (sensors, converter, wheels) --> rig --> firmware in QEMU
//!     |             `---truth---> verdict <-------------estimates----------------'
//!     `------expectations------------^
//! ```
//!
//! Time goes by milliseconds, in lockstep: the firmware's millisecond ends when the host has answered it. Everything random
//! comes from the scenario's seed, so the same scenario gives the same bits.

mod bus;
mod parts;
mod rig;
mod scenario;
mod vehicle;
mod verdict;

use std::time::Instant;

use kou_app::controller::VitalsRead;
use kou_app::rig::{FromHost, Order};
use kou_estimator::Calibration;
use serde::Serialize;

use crate::input::InputError;
use crate::machine::Machine;

pub use bus::{Bus, Traffic};
pub use parts::Parts;
pub use rig::Rig;
pub use scenario::{Command, Kind, Scenario, Sensor};
pub use vehicle::{Truth, Vehicle};
pub use verdict::{Finding, Verdict};

use super::{PilError, PilOptions};

/// Name of the firmware's binary that the closed loop runs.
pub const CONTROLLER: &str = "kou-qemu-controller";

/// Why a closed loop did not come to its end.
#[derive(Debug, thiserror::Error)]
pub enum LoopError {
    /// Bad input.
    #[error(transparent)]
    Input(#[from] InputError),
    /// The full model gave up.
    #[error(transparent)]
    Simulation(#[from] crate::full::SimError),
    /// The firmware.
    #[error(transparent)]
    Pil(#[from] PilError),
}

/// What a closed loop came to.
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
    /// Outputs in which the coefficient seen is valid.
    pub valid: u64,
    /// CRC-32 over all outputs: the same for the same scenario, machine, calibration and firmware.
    pub outputs_crc32: u32,
    /// What was expected and what came.
    pub findings: Vec<Finding>,
    /// What was on the bus.
    pub bus: Traffic,
    /// Missed deadlines of all tasks.
    pub missed_deadlines: u64,
    /// Longest lateness of any task, us.
    pub latest_us: u32,
    /// Longest turn of each task, us: sample, estimate, publish, store, supervise.
    pub longest_us: [u32; 5],
    /// Turns of each task.
    pub turns: [u32; 5],
    /// Deepest stack, bytes.
    pub stack_bytes: u32,
    /// Whether every expectation was met, no deadline missed, and the firmware ended because it was told to.
    pub passed: bool,
}

/// Drives the firmware through a scenario.
///
/// # Errors
/// Bad input, a vehicle that cannot be simulated, or a firmware that ends before it is told to: an unasked reset.
pub fn run(
    options: &PilOptions,
    machine: &Machine,
    calibration: &Calibration,
    record: &[u8],
    scenario: &Scenario,
    mut progress: impl FnMut(u64),
) -> Result<LoopReport, LoopError> {
    let mut vehicle = Vehicle::new(machine, calibration, scenario)?;
    let mut parts = Parts::new(scenario);
    let mut verdict = Verdict::new(scenario);
    let mut bus = Bus::new(scenario);
    let mut rig = Rig::start(options, record)?;
    let begin = Instant::now();
    let mut last: Option<([VitalsRead; 5], u32)> = None;
    let milliseconds = (scenario.duration_s * 1000.0).round() as u64;
    for ms in 1..=milliseconds {
        let time_s = ms as f64 * 1e-3;
        let truth = vehicle.millisecond(&scenario.command(time_s))?;
        let signals = parts.millisecond(time_s, &truth);
        let asked = rig.receive()?;
        if let Some(output) = &asked.output {
            verdict.judge(time_s, &truth, output, asked.sample.as_ref());
        }
        if let Some(vitals) = asked.vitals {
            last = Some((vitals, asked.stack_bytes));
        }
        let spi = asked.spi.iter().map(|request| signals.answer(*request)).collect();
        rig.send(&FromHost {
            spi,
            count: signals.count,
            pump: signals.pump,
            motor: signals.motor,
            can: bus.millisecond(time_s, &asked.can),
            order: Order::Run,
        })?;
        if ms.is_multiple_of(1000) {
            progress(1000);
        }
    }
    let elapsed_s = begin.elapsed().as_secs_f64().max(f64::MIN_POSITIVE);
    rig.stop()?;
    let (vitals, stack_bytes) = last.unwrap_or_default();
    let missed_deadlines = vitals.iter().map(|vital| u64::from(vital.missed)).sum();
    let findings = verdict.findings();
    Ok(LoopReport {
        scenario: scenario.name.clone(),
        simulated_s: scenario.duration_s,
        real_time_factor: scenario.duration_s / elapsed_s,
        outputs: verdict.outputs(),
        valid: verdict.valid(),
        outputs_crc32: verdict.crc32(),
        passed: missed_deadlines == 0 && findings.iter().all(|finding| finding.met),
        findings,
        bus: bus.traffic(),
        missed_deadlines,
        latest_us: vitals.iter().map(|vital| vital.latest_us).max().unwrap_or(0),
        longest_us: vitals.map(|vital| vital.longest_us),
        turns: vitals.map(|vital| vital.turns),
        stack_bytes,
    })
}
