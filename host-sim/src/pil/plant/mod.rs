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
mod flash;
mod law;
mod outage;
mod parts;
mod rig;
mod scenario;
mod tool;
mod vehicle;
mod verdict;

use std::time::Instant;

use kou_app::controller::TaskStatsSnapshot;
use kou_app::diagnostics::ResetCause;
use kou_emulation::{EmulationStart, Order, TickReply};
use kou_estimator::Calibration;
use serde::Serialize;

use kou_lumped::machine::Machine;
use kou_records::InputError;

pub use bus::{Bus, Traffic};
pub use flash::{Flash, Kept};
pub use law::{LawFinding, LawWatch};
pub use outage::{OutageFinding, Outages, SETTLED_S};
pub use parts::Parts;
pub use rig::{Heard, Rig};
pub use scenario::{Command, Kind, Scenario, Sensor};
pub use tool::{Tool, UpdateFinding, key_of};
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
    Simulation(#[from] kou_lumped::SimError),
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
    /// Failures of the supply, and what was found afterwards.
    pub outages: Vec<OutageFinding>,
    /// Calibration updates, and what came of them.
    pub updates: Vec<UpdateFinding>,
    /// Which calibration the outputs were made with.
    pub law: LawFinding,
    /// Troubles in flash at the end, and how often each occurred.
    pub troubles: Vec<(String, u8)>,
    /// Pages of flash erased.
    pub erasures: u64,
    /// What was on the bus.
    pub bus: Traffic,
    /// Missed deadlines of all tasks.
    pub missed_deadlines: u64,
    /// Longest lateness of any task, us.
    pub latest_us: u32,
    /// Longest turn of each task, us: sample, estimate, publish, store, supervise.
    pub longest_us: [u32; 5],
    /// Turns of each task since the last start.
    pub turns: [u32; 5],
    /// Deepest stack, bytes.
    pub stack_bytes: u32,
    /// Whether every expectation was met, nothing that was kept was lost, every update came to what was expected, no
    /// deadline was missed, and the firmware ended because it was told to.
    pub passed: bool,
}

/// Drives the firmware through a scenario. `record` is that of the default calibration; empty for none.
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
    let mut run = Run::new(machine, calibration, scenario)?;
    let begin = EmulationStart {
        default: record,
        key: Some(key_of(scenario)),
        cause: ResetCause::PowerOn,
        crash_record: None,
        write_period_s: scenario.keep_s,
    };
    let mut rig = Some(Rig::start(options, &begin)?);
    let started = Instant::now();
    let mut back_ms = 0;
    let milliseconds = (scenario.duration_s * 1000.0).round() as u64;
    for ms in 1..=milliseconds {
        if rig.is_none() && ms >= back_ms {
            rig =
                Some(Rig::start(options, &EmulationStart { cause: ResetCause::BrownOut, ..begin.clone() })?);
        }
        let time_s = ms as f64 * 1e-3;
        if let Some(off_s) = run.millisecond(time_s, &scenario.command(time_s), rig.as_mut())? {
            back_ms = ms + (off_s * 1000.0).round() as u64;
            rig = None;
        }
        if ms.is_multiple_of(1000) {
            progress(1000);
        }
    }
    let elapsed_s = started.elapsed().as_secs_f64().max(f64::MIN_POSITIVE);
    if let Some(rig) = rig {
        rig.stop(&mut run.flash)?;
    }
    Ok(run.report(scenario, elapsed_s))
}

/// Everything around the controller.
struct Run {
    vehicle: Vehicle,
    parts: Parts,
    verdict: Verdict,
    bus: Bus,
    tool: Tool,
    flash: Flash,
    outages: Outages,
    law: LawWatch,
    /// Of the present run of the firmware, and missed deadlines of those before.
    last: ([TaskStatsSnapshot; 5], u32),
    missed_before: u64,
}

impl Run {
    fn new(machine: &Machine, calibration: &Calibration, scenario: &Scenario) -> Result<Self, LoopError> {
        Ok(Self {
            vehicle: Vehicle::new(machine, calibration, scenario)?,
            parts: Parts::new(scenario),
            verdict: Verdict::new(scenario),
            bus: Bus::new(scenario),
            tool: Tool::new(scenario, calibration)?,
            flash: Flash::default(),
            outages: Outages::new(scenario, calibration),
            law: LawWatch::new(calibration),
            last: Default::default(),
            missed_before: 0,
        })
    }

    /// One millisecond, of which the controller takes part while it has power. When its supply fails: for how long, s.
    fn millisecond(
        &mut self,
        time_s: f64,
        command: &Command,
        rig: Option<&mut Rig>,
    ) -> Result<Option<f64>, LoopError> {
        let truth = self.vehicle.millisecond(command)?;
        let signals = self.parts.millisecond(time_s, &truth);
        let Some(rig) = rig else {
            let others = self.tool.millisecond(time_s, &[]);
            drop((others, self.bus.millisecond(time_s, &[])));
            return Ok(None);
        };
        self.outages.millisecond(time_s, &mut self.flash);
        let asked = match rig.receive(&mut self.flash)? {
            Heard::Tick(asked) => asked,
            Heard::NoPower => {
                self.missed_before = self.missed_deadlines();
                self.last = Default::default();
                return Ok(Some(self.outages.fails(time_s, &mut self.flash)));
            }
        };
        self.flash.writes(asked.writing);
        if let Some(output) = &asked.output {
            self.verdict.judge(time_s, &truth, output, asked.sample.as_ref());
            self.outages.told(time_s, output);
            self.law.watch(output, asked.sample.as_ref(), &self.tool);
        }
        if let Some(task_stats) = asked.task_stats {
            self.last = (task_stats, asked.stack_bytes);
        }
        let mut can = self.bus.millisecond(time_s, &asked.can);
        if let Some(frame) = self.tool.millisecond(time_s, &asked.can) {
            // On a bus that others fill the tool must wait as anybody must; it then falls silent.
            can.push(frame).ok();
        }
        rig.send(&TickReply {
            spi: asked.spi.iter().map(|request| signals.answer(*request)).collect(),
            count: signals.count,
            pump: signals.pump,
            motor: signals.motor,
            can,
            order: Order::Run,
        })?;
        Ok(None)
    }

    fn missed_deadlines(&self) -> u64 {
        self.missed_before + self.last.0.iter().map(|stats| u64::from(stats.missed)).sum::<u64>()
    }

    fn report(&self, scenario: &Scenario, elapsed_s: f64) -> LoopReport {
        let (task_stats, stack_bytes) = self.last;
        let findings = self.verdict.findings();
        let (outages, updates, law) = (self.outages.findings(), self.tool.findings(), self.law.finding());
        let missed_deadlines = self.missed_deadlines();
        let passed = missed_deadlines == 0
            && findings.iter().all(|finding| finding.met)
            && outages.iter().all(|finding| finding.met)
            && updates.iter().all(|finding| finding.met)
            && law.foreign == 0;
        let faults = Kept::of(self.flash.cells()).ok().and_then(|kept| kept.faults);
        let troubles = faults.iter().flat_map(|memory| memory.entries());
        LoopReport {
            scenario: scenario.name.clone(),
            simulated_s: scenario.duration_s,
            real_time_factor: scenario.duration_s / elapsed_s,
            outputs: self.verdict.outputs(),
            valid: self.verdict.valid(),
            outputs_crc32: self.verdict.crc32(),
            passed,
            findings,
            outages,
            updates,
            law,
            troubles: troubles
                .map(|entry| (entry.code().map_or_else(String::new, |c| format!("{c:?}")), entry.occurrences))
                .collect(),
            erasures: self.flash.cells().erasures() as u64,
            bus: self.bus.traffic(),
            missed_deadlines,
            latest_us: task_stats.iter().map(|stats| stats.max_jitter_us).max().unwrap_or(0),
            longest_us: task_stats.map(|stats| stats.max_execution_us),
            turns: task_stats.map(|stats| stats.cycles),
            stack_bytes,
        }
    }
}
