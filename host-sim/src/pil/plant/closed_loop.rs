//! The closed loop: one millisecond after the other through vehicle, sensors, controller and bus.

use std::time::Instant;

use kou_app::controller::TaskStatsSnapshot;
use kou_app::diagnostics::ResetCause;
use kou_emulation::{EmulationStart, Order, TickReply};
use kou_estimator::Calibration;
use kou_lumped::machine::Machine;

use super::calibration_in_use::CalibrationTracker;
use super::can_bus::SimulatedCanBus;
use super::controller::{ControllerEvent, EmulatedController};
use super::emulated_flash::{EmulatedFlash, StoredRecords};
use super::error::LoopError;
use super::outage::Outages;
use super::report::LoopReport;
use super::scenario::{DriverCommand, Scenario};
use super::scenario_check::ScenarioCheck;
use super::sensor_emulator::SensorEmulator;
use super::service_tool::{ServiceTool, key_of};
use super::vehicle::Vehicle;
use crate::pil::options::PilOptions;

/// Drives the firmware through a scenario. `record` is that of the default calibration; empty for none.
///
/// # Errors
/// Bad input, a vehicle that cannot be simulated, or a firmware that ends before it is stopped: an unexpected reset.
pub fn run(
    options: &PilOptions,
    machine: &Machine,
    calibration: &Calibration,
    record: &[u8],
    scenario: &Scenario,
    mut progress: impl FnMut(u64),
) -> Result<LoopReport, LoopError> {
    let mut closed_loop = ClosedLoop::new(machine, calibration, scenario)?;
    let begin = EmulationStart {
        default: record,
        key: Some(key_of(scenario)),
        cause: ResetCause::PowerOn,
        crash_record: None,
        write_period_s: scenario.keep_s,
    };
    let mut controller = Some(EmulatedController::start(options, &begin)?);
    let started = Instant::now();
    let mut back_ms = 0;
    let milliseconds = (scenario.duration_s * 1000.0).round() as u64;
    for ms in 1..=milliseconds {
        if controller.is_none() && ms >= back_ms {
            controller = Some(EmulatedController::start(
                options,
                &EmulationStart { cause: ResetCause::BrownOut, ..begin.clone() },
            )?);
        }
        let time_s = ms as f64 * 1e-3;
        if let Some(off_s) =
            closed_loop.millisecond(time_s, &scenario.command(time_s), controller.as_mut())?
        {
            back_ms = ms + (off_s * 1000.0).round() as u64;
            controller = None;
        }
        if ms.is_multiple_of(1000) {
            progress(1000);
        }
    }
    let elapsed_s = started.elapsed().as_secs_f64().max(f64::MIN_POSITIVE);
    if let Some(controller) = controller {
        controller.stop(&mut closed_loop.flash)?;
    }
    Ok(closed_loop.report(scenario, elapsed_s))
}

/// Everything around the controller, and the observers of its outputs.
struct ClosedLoop {
    vehicle: Vehicle,
    sensors: SensorEmulator,
    check: ScenarioCheck,
    bus: SimulatedCanBus,
    tool: ServiceTool,
    flash: EmulatedFlash,
    outages: Outages,
    in_use: CalibrationTracker,
    /// Task statistics since the last start, and deadlines missed before it.
    last: ([TaskStatsSnapshot; 5], u32),
    missed_before: u64,
}

impl ClosedLoop {
    fn new(machine: &Machine, calibration: &Calibration, scenario: &Scenario) -> Result<Self, LoopError> {
        Ok(Self {
            vehicle: Vehicle::new(machine, calibration, scenario)?,
            sensors: SensorEmulator::new(scenario),
            check: ScenarioCheck::new(scenario),
            bus: SimulatedCanBus::new(scenario),
            tool: ServiceTool::new(scenario, calibration)?,
            flash: EmulatedFlash::default(),
            outages: Outages::new(scenario, calibration),
            in_use: CalibrationTracker::new(calibration),
            last: Default::default(),
            missed_before: 0,
        })
    }

    /// Simulates one millisecond. Returns how long the supply is off, s, where it fails in it.
    fn millisecond(
        &mut self,
        time_s: f64,
        command: &DriverCommand,
        controller: Option<&mut EmulatedController>,
    ) -> Result<Option<f64>, LoopError> {
        let truth = self.vehicle.millisecond(command)?;
        let signals = self.sensors.millisecond(time_s, &truth);
        let Some(controller) = controller else {
            let others = self.tool.millisecond(time_s, &[]);
            drop((others, self.bus.millisecond(time_s, &[])));
            return Ok(None);
        };
        self.outages.millisecond(time_s, &mut self.flash);
        let request = match controller.receive(&mut self.flash)? {
            ControllerEvent::Tick(request) => request,
            ControllerEvent::NoPower => {
                self.missed_before = self.missed_deadlines();
                self.last = Default::default();
                return Ok(Some(self.outages.power_lost(time_s, &mut self.flash)));
            }
        };
        self.flash.observe_write(request.writing);
        if let Some(output) = &request.output {
            self.check.push(time_s, &truth, output, request.sample.as_ref());
            self.outages.push(time_s, output);
            self.in_use.push(output, request.sample.as_ref(), &self.tool);
        }
        if let Some(task_stats) = request.task_stats {
            self.last = (task_stats, request.stack_bytes);
        }
        let mut can = self.bus.millisecond(time_s, &request.can);
        if let Some(frame) = self.tool.millisecond(time_s, &request.can) {
            // On a full bus the tool has to wait as any node; its transfer then times out.
            can.push(frame).ok();
        }
        controller.send(&TickReply {
            spi: request.spi.iter().map(|word| signals.answer(*word)).collect(),
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
        let findings = self.check.findings();
        let (outages, updates, law) = (self.outages.findings(), self.tool.findings(), self.in_use.finding());
        let missed_deadlines = self.missed_deadlines();
        let passed = missed_deadlines == 0
            && findings.iter().all(|finding| finding.met)
            && outages.iter().all(|finding| finding.met)
            && updates.iter().all(|finding| finding.met)
            && law.foreign == 0;
        let faults = StoredRecords::read(self.flash.cells()).ok().and_then(|records| records.faults);
        let dtcs = faults.iter().flat_map(|memory| memory.entries());
        LoopReport {
            scenario: scenario.name.clone(),
            simulated_s: scenario.duration_s,
            real_time_factor: scenario.duration_s / elapsed_s,
            outputs: self.check.outputs(),
            valid: self.check.valid(),
            outputs_crc32: self.check.crc32(),
            passed,
            findings,
            outages,
            updates,
            law,
            faults: dtcs
                .map(|entry| (entry.code().map_or_else(String::new, |c| format!("{c:?}")), entry.occurrences))
                .collect(),
            erasures: self.flash.cells().erasures() as u64,
            bus: self.bus.traffic(),
            missed_deadlines,
            max_jitter_us: task_stats.iter().map(|stats| stats.max_jitter_us).max().unwrap_or(0),
            max_execution_us: task_stats.map(|stats| stats.max_execution_us),
            cycles: task_stats.map(|stats| stats.cycles),
            stack_bytes,
        }
    }
}
