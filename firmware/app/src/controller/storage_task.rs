//! Task `storage`: loads calibration and learned health from flash, processes calibration updates, and writes the
//! records that must survive a power cut.
//!
//! ```text
//! start: repair of record copies --> calibration: stored, else default, else none (reported) --> estimate
//!        --> learned health, when learned with this calibration --> estimate
//!        --> fault memory, operating counters, cause of the last reset
//! then:  update commands as they arrive; once a second at most one record that is due
//! ```
//!
//! A write is always awaited to its end. The task has the lowest priority, so a flash that works in parallel to the
//! processor delays no other task; one that stalls the processor causes missed deadlines, which are recorded as a
//! fault.

use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::{Duration, Instant, Timer, with_deadline};
use embedded_storage_async::nor_flash::NorFlash;
use kou_estimator::units::{Megapascal, Micros};

use super::handover::Mailbox;
use super::periodic::{Ticker, now};
use super::periods::STORAGE_PERIOD;
use super::shared::Controller;
use super::write_schedule::{DueWrite, WriteSchedule, WriteScheduleParams};
use crate::calibration::CalibrationState;
use crate::diagnostics::crash_log;
use crate::diagnostics::{CrashRecord, FaultCode, FaultMemory, ResetCause};
use crate::log::{info, warning};
use crate::outlined_await::await_outlined;
use crate::storage::{CrashReport, HealthRecord, OperatingCounters, Record, RecordKind, StoreError};
use crate::update::{CommandOutcome, KeySource, UpdateService, is_loaded};

/// Pressure difference from which a drive without a calibration counts as loaded.
const UNCALIBRATED_MIN_DIFFERENCE: Megapascal = Megapascal(2.0);
/// Period of polling whether the estimating task has emptied the mailbox.
const POLL_PERIOD: Duration = Duration::from_millis(2);

/// Reason of the present start.
#[derive(Debug, Clone)]
pub struct StartReason {
    /// Cause reported by the hardware.
    pub cause: ResetCause,
    /// Crash record left by the previous run.
    pub crash_record: Option<CrashRecord>,
}

/// Storage task: owner of all records. Outside the asynchronous task, which is moved when it is started.
pub struct StorageTask<'d, F: NorFlash, K> {
    service: UpdateService<'d, F, K>,
    schedule: WriteSchedule,
    cause: ResetCause,
    /// Crash of the previous run, to be written.
    stop: Option<CrashReport>,
    /// Operating counters at the start of this run.
    counters: OperatingCounters,
    min_pressure_difference: Megapascal,
    /// Level, standard error and number of changes of learned health when last written.
    written: Option<(u32, u32, u16)>,
    faults_changed: bool,
    missed: u32,
}

impl<'d, F: NorFlash, K: KeySource> StorageTask<'d, F, K> {
    /// Combines the parts of the task.
    pub fn new(service: UpdateService<'d, F, K>, rates: WriteScheduleParams, start: StartReason) -> Self {
        Self {
            service,
            schedule: WriteSchedule::new(rates),
            cause: crash_log::reset_cause(start.cause, start.crash_record.as_ref()),
            stop: start.crash_record.map(|crash| CrashReport { operating_s: 0, crash }),
            counters: OperatingCounters::new(),
            min_pressure_difference: UNCALIBRATED_MIN_DIFFERENCE,
            written: None,
            faults_changed: false,
            missed: 0,
        }
    }

    /// Store and session, for inspection after the task has ended.
    pub fn service(&mut self) -> &mut UpdateService<'d, F, K> {
        &mut self.service
    }

    async fn open<M: RawMutex>(&mut self, controller: &Controller<M>) {
        let crc = await_outlined!(self.load(controller));
        // Learned health belongs to the calibration in use, which must be handed over first.
        while let Some(crc) = crc {
            let mut slot = controller.handover.lock().await;
            if matches!(*slot, Mailbox::Empty) {
                let to = |record: &mut HealthRecord| restore(&mut slot, crc, record);
                await_outlined!(self.service.store().read_to(to)).ok();
                break;
            }
            drop(slot);
            Timer::after(POLL_PERIOD).await;
        }
        let to = |faults: &mut FaultMemory| controller.faults(|memory| memory.restore(faults));
        await_outlined!(self.service.store().read_to(to)).ok();
        if let Ok(Some(counters)) = self.service.store().read().await {
            self.counters = counters;
        }
        self.record_start(controller).await;
    }

    /// Selects the calibration to use and hands it over; returns its CRC.
    async fn load<M: RawMutex>(&mut self, controller: &Controller<M>) -> Option<u32> {
        let mut slot = controller.handover.lock().await;
        let opened = await_outlined!(self.service.open(&mut *slot));
        if let Some(code) = opened.fault {
            controller.confirm_fault(code);
        }
        if opened.adopted.is_none() {
            warning!("no calibration: nothing is estimated until one comes over the bus");
            controller.set_calibration(CalibrationState::NONE);
        }
        self.hand_over(&mut slot, opened.adopted)
    }

    async fn record_start<M: RawMutex>(&mut self, controller: &Controller<M>) {
        controller.set_previous_operating_s(self.counters.operating_s);
        if let Some(code) = self.cause.fault_code() {
            controller.record_fault_event(code);
        }
        self.counters.count_start(self.cause);
        info!(
            "start {=u32} after {=u32} s of operation, by {}",
            self.counters.starts, self.counters.operating_s, self.cause
        );
        let counters = self.counters;
        write_record(&mut self.service, controller, &counters).await;
        if let Some(stop) = &mut self.stop {
            stop.operating_s = counters.operating_s;
            write_record(&mut self.service, controller, stop).await;
        }
    }

    /// Handles a tool's command and queues the answer.
    async fn handle_command<M: RawMutex>(&mut self, controller: &Controller<M>, tool: u8, command: [u8; 8]) {
        let loaded =
            controller.sample().is_none_or(|sample| is_loaded(&sample, self.min_pressure_difference));
        // Write pending learned health first: the update reuses the mailbox.
        await_outlined!(self.write_learned(controller));
        let mut slot = controller.handover.lock().await;
        controller.set_writing(Some(RecordKind::Calibration));
        let handled = await_outlined!(self.service.receive(now(), tool, command, loaded, &mut *slot));
        controller.set_writing(None);
        if self.hand_over(&mut slot, handled.adopted).is_some() {
            self.written = None;
        }
        answer(controller, &handled);
    }

    /// Releases the parameters in the mailbox to the estimating task; returns the calibration's CRC.
    fn hand_over(&mut self, slot: &mut Mailbox, adopted: Option<CalibrationState>) -> Option<u32> {
        let calibration = adopted?;
        self.min_pressure_difference = slot.params()?.limits().min_pressure_difference;
        slot.release(calibration);
        Some(calibration.crc)
    }

    /// Writes learned health once `estimate` has filled it in; returns whether it did.
    async fn write_learned<M: RawMutex>(&mut self, controller: &Controller<M>) -> bool {
        let mut slot = controller.handover.lock().await;
        let Mailbox::Requested { record, is_filled: true } = &*slot else { return false };
        write_record(&mut self.service, controller, record).await;
        *slot = Mailbox::Empty;
        true
    }

    /// Work that is due once a second.
    async fn cycle<M: RawMutex>(&mut self, controller: &Controller<M>) {
        answer(controller, &self.service.poll(now()));
        self.check_overruns(controller);
        // Requested in the previous cycle.
        if await_outlined!(self.write_learned(controller)) {
            return;
        }
        // `estimate` collects its item within milliseconds; it must not be overwritten before.
        if !matches!(*controller.handover.lock().await, Mailbox::Empty) {
            return;
        }
        self.faults_changed |= controller.faults(|memory| memory.take_changed());
        let health = learned_now(controller);
        let health_changed = health.is_some() && health != self.written;
        match self.schedule.due(now(), self.faults_changed, health_changed) {
            DueWrite::Nothing => {}
            DueWrite::Faults => {
                self.faults_changed = false;
                await_outlined!(self.write_faults(controller));
            }
            DueWrite::Health => {
                self.written = health;
                controller.handover.lock().await.request_learned();
            }
            DueWrite::OperatingCounters => {
                let counters = self.counters_at(now());
                write_record(&mut self.service, controller, &counters).await;
            }
        }
    }

    async fn write_faults<M: RawMutex>(&mut self, controller: &Controller<M>) {
        let mut slot = controller.handover.lock().await;
        // A copy, because other tasks are locked out during access to the memory.
        copy_faults(controller, &mut slot);
        if let Mailbox::Faults(faults) = &*slot {
            write_record(&mut self.service, controller, faults).await;
        }
        *slot = Mailbox::Empty;
    }

    fn counters_at(&self, now: Micros) -> OperatingCounters {
        let mut counters = self.counters;
        counters.add_operating_time(u32::try_from(now.0 / 1_000_000).unwrap_or(u32::MAX));
        counters
    }

    fn check_overruns<M: RawMutex>(&mut self, controller: &Controller<M>) {
        let missed =
            controller.task_stats.read().iter().fold(0_u32, |sum, stats| sum.saturating_add(stats.missed));
        if missed > self.missed {
            warning!("{=u32} deadlines missed", missed);
            controller.record_fault_event(FaultCode::Overrun);
        }
        self.missed = missed;
    }
}

/// Writes a record, and marks it as being written meanwhile.
async fn write_record<'r, M: RawMutex, F: NorFlash, K: KeySource, R: Record<'r>>(
    service: &mut UpdateService<'_, F, K>,
    controller: &Controller<M>,
    record: &R,
) {
    controller.set_writing(Some(R::KIND));
    let result = await_outlined!(service.write(record));
    controller.set_writing(None);
    report_result(controller, result);
}

// Not inlined: the copy would otherwise occupy the task's memory permanently.
#[inline(never)]
fn copy_faults<M: RawMutex>(controller: &Controller<M>, slot: &mut Mailbox) {
    controller.faults(|memory| *slot = Mailbox::Faults(memory.clone()));
}

/// Level, standard error and number of changes of learned health, to detect changes.
fn learned_now<M: RawMutex>(controller: &Controller<M>) -> Option<(u32, u32, u16)> {
    let health = controller.output(now()).ok()?.health;
    Some((health.level.get().to_bits(), health.level_se.get().to_bits(), health.changes))
}

fn report_result<M: RawMutex>(controller: &Controller<M>, result: Result<(), StoreError>) {
    match result {
        Ok(()) => controller.heal_fault(FaultCode::StorageFailed),
        Err(error) => {
            warning!("flash write failed: {}", error);
            controller.confirm_fault(FaultCode::StorageFailed);
        }
    }
}

/// Hands learned health to the estimating task if it was learned with the calibration in use and is valid.
fn restore(slot: &mut Mailbox, crc: u32, record: &HealthRecord) {
    match record.for_calibration(crc) {
        Some(state) if state.is_sound() => slot.put_learned(state),
        _ => warning!("learned health is of another calibration: it is learned anew"),
    }
}

fn answer<M: RawMutex>(controller: &Controller<M>, handled: &CommandOutcome) {
    if let Some(code) = handled.fault {
        controller.record_fault_event(code);
    }
    if let Some((tool, answer)) = handled.answer {
        // A tool that sends faster than the bus accepts answers loses them, and repeats its command.
        controller.answers.try_send((tool, answer.to_bytes())).ok();
    }
}

/// Runs the storage task; never returns.
pub async fn run_storage<M: RawMutex, F: NorFlash, K: KeySource>(
    controller: &Controller<M>,
    start: Instant,
    task: &mut StorageTask<'_, F, K>,
) -> ! {
    task.open(controller).await;
    let mut ticker = Ticker::new(start, STORAGE_PERIOD, &controller.task_stats.storage);
    loop {
        let due = ticker.end_cycle();
        // Commands until the next cycle is due; bounded, so that a flooding tool cannot keep the task from its
        // cycles.
        while Instant::now() < due {
            match with_deadline(due, controller.commands.receive()).await {
                Ok((tool, command)) => task.handle_command(controller, tool, command).await,
                Err(_) => break,
            }
        }
        ticker.begin_cycle();
        task.cycle(controller).await;
    }
}
