//! The storage task among the controller's other tasks, on the host with a simulated clock: start, restarts and faults of the
//! flash.

use std::cell::RefCell;
use std::future::Future;
use std::ops::Range;
use std::pin::Pin;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::task::{Context, Waker};

use embassy_futures::block_on;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_time::{Duration, Instant, MockDriver};
use host_sim::update::{Addresses, frames};
use kou_app::calibration::CalibrationSource;
use kou_app::controller::{
    CanInterface, CanPort, Controller, Estimator, FrontEnd, NoEstimate, SensorsMemory, StartReason,
    StorageTask, WriteScheduleConfig, WriteScheduleParams, run_estimate, run_publish, run_sample,
    run_storage,
};
use kou_app::diagnostics::ResetCause;
use kou_app::diagnostics::crash_log::{CrashKind, CrashRecord};
use kou_app::diagnostics::{FaultCode, FaultMemory};
use kou_app::j1939::node::UPDATE;
use kou_app::j1939::{Frame, Name, NameConfig, Node};
use kou_app::sensors::adc::{ConversionError, Input};
use kou_app::sensors::set::{CHANNELS, SensorInputs, SensorsParams};
use kou_app::sensors::wiring;
use kou_app::storage::{CrashReport, HealthRecord, MIN_BYTES, OperatingCounters, Store, StoredCalibration};
use kou_app::update::wire::UpdateAnswer;
use kou_app::update::{UpdateService, UpdateSession};
use kou_emulation::ram_flash::Torn;
use kou_estimator::State;
use kou_estimator::record::crc32;
use kou_estimator::units::Micros;
use kou_tests::samples::learned;
use kou_tests::{TestFlash, TestKey, record_of, reference_calibration, reference_params};

/// Exclusive use of the simulated clock, of which the process has one.
fn clock() -> MutexGuard<'static, ()> {
    static CLOCK: Mutex<()> = Mutex::new(());
    CLOCK.lock().unwrap_or_else(PoisonError::into_inner)
}

fn key() -> TestKey {
    TestKey::from_seed(0x42)
}

/// Front end of a drive at standstill, with a converter that does not answer; the duration delays one read.
struct SilentConverter(Duration);

impl FrontEnd for SilentConverter {
    async fn read(&mut self, _: &[Option<Input>; CHANNELS], into: &mut SensorInputs) {
        if Instant::now().as_millis() == 5_000 {
            MockDriver::get().advance(self.0);
        }
        into.analog = [Err(ConversionError::NoAnswer); CHANNELS];
        into.count = (Instant::now().as_micros() * 10) as u32;
    }
}

/// An update tool on the bus: it sends a frame once the one before has been answered.
#[derive(Default)]
struct UpdateTool {
    to_send: Vec<Frame>,
    answers: Vec<UpdateAnswer>,
    waits: bool,
}

/// The bus as the update tool sees it.
struct UpdateToolPort<'a>(&'a RefCell<UpdateTool>);

impl CanPort for UpdateToolPort<'_> {
    fn receive(&mut self) -> Option<Frame> {
        let mut tool = self.0.borrow_mut();
        if tool.waits || tool.to_send.is_empty() || Instant::now().as_millis() < 2_500 {
            return None;
        }
        tool.waits = true;
        Some(tool.to_send.remove(0))
    }

    fn send(&mut self, frame: &Frame) -> bool {
        let mut tool = self.0.borrow_mut();
        if frame.id().pgn() == UPDATE {
            tool.waits = false;
            let answer = frame.data().try_into().ok().and_then(UpdateAnswer::from_bytes);
            tool.answers.extend(answer);
        }
        true
    }
}

/// State after the tasks have run.
struct TaskRun {
    flash: TestFlash,
    controller: Controller<NoopRawMutex>,
    tool: UpdateTool,
}

/// Runs all tasks but the supervisor for some milliseconds.
fn run(
    flash: TestFlash,
    default: Option<&[u8]>,
    begin: StartReason,
    to_send: Vec<Frame>,
    busy: Duration,
    ms: u64,
) -> TaskRun {
    run_with_pause(flash, default, begin, to_send, busy, ms, 0..0)
}

/// The same; the task `estimate` is not polled during `pause`, in milliseconds.
fn run_with_pause(
    flash: TestFlash,
    default: Option<&[u8]>,
    begin: StartReason,
    to_send: Vec<Frame>,
    busy: Duration,
    ms: u64,
    pause: Range<u64>,
) -> TaskRun {
    // A reset restarts the clock.
    MockDriver::get().reset();
    let controller = Controller::<NoopRawMutex>::new();
    let params = SensorsParams::new(&wiring::REFERENCE).unwrap();
    let tool = RefCell::new(UpdateTool { to_send, ..UpdateTool::default() });
    let rates = WriteScheduleConfig { health_s: 3, counters_s: 4, ..WriteScheduleConfig::VEHICLE };
    let (mut store, mut session) = (Store::new(flash, 0..MIN_BYTES).unwrap(), UpdateSession::new());
    let mut storage_task = StorageTask::new(
        UpdateService::new(&mut store, &mut session, key(), default),
        WriteScheduleParams::new(&rates).unwrap(),
        begin,
    );
    let start = Instant::now();
    {
        let (c, params, tool, k) = (&controller, &params, &tool, &mut storage_task);
        let node = Node::new(Name::new(&NameConfig::transmission(1)).unwrap(), 0x8C);
        let mut tasks: [Pin<Box<dyn Future<Output = ()> + '_>>; 4] = [
            Box::pin(async move {
                run_sample(c, start, params, &mut SilentConverter(busy), &mut SensorsMemory::new()).await
            }),
            Box::pin(async move { run_estimate(c, start, &mut Estimator::new()).await }),
            Box::pin(async move {
                run_publish(c, start, &mut CanInterface::new(UpdateToolPort(tool), node, c)).await
            }),
            Box::pin(async move { run_storage(c, start, k).await }),
        ];
        let mut context = Context::from_waker(Waker::noop());
        for now_ms in 0..ms {
            for (number, task) in tasks.iter_mut().enumerate() {
                if number == 1 && pause.contains(&now_ms) {
                    continue;
                }
                assert!(task.as_mut().poll(&mut context).is_pending(), "a task has ended");
            }
            MockDriver::get().advance(Duration::from_millis(1));
        }
    }
    let store = storage_task.service().store();
    let flash = store.flash().clone();
    TaskRun { flash, controller, tool: tool.into_inner() }
}

fn power_on() -> StartReason {
    StartReason { cause: ResetCause::PowerOn, crash_record: None }
}

fn read<R: for<'a> kou_app::storage::Record<'a>>(flash: &TestFlash) -> Option<R> {
    let mut store = Store::new(flash.clone(), 0..MIN_BYTES).unwrap();
    block_on(store.read()).unwrap()
}

fn crc_of(record: &[u8]) -> u32 {
    crc32(&record[..record.len() - 4])
}

fn with_records(write: impl AsyncFnOnce(&mut Store<TestFlash>)) -> TestFlash {
    let mut store = Store::new(TestFlash::new(), 0..MIN_BYTES).unwrap();
    block_on(write(&mut store));
    store.into_flash()
}

const NOT_BUSY: Duration = Duration::from_ticks(0);

#[test]
fn learned_health_is_restored_with_its_own_calibration_and_with_no_other() {
    let _guard = clock();
    let (params, state) = (reference_params(), learned(1));
    let default = record_of(&reference_calibration());
    for (crc, is_restored) in [(crc_of(&default), true), (crc_of(&default) ^ 1, false)] {
        let health = HealthRecord { calibration_crc: crc, state: state.clone() };
        let flash = with_records(async |store| store.write(&health).await.unwrap());
        let controller = run(flash, Some(&default), power_on(), Vec::new(), NOT_BUSY, 300).controller;
        let now = Micros(Instant::now().as_micros());
        let level = controller.output(now).unwrap().health.level;
        let sample = kou_estimator::Sample::empty(Micros(0));
        let restored = kou_estimator::step(&params, &mut State::with_health(state.clone()), &sample);
        assert_ne!(restored.health.level.get(), 1.0, "something was learned");
        assert_eq!(level == restored.health.level, is_restored);
    }
}

#[test]
fn without_a_calibration_the_first_update_over_can_is_accepted_and_survives_a_restart() {
    let _guard = clock();
    let addresses = Addresses { controller: 0x8C, tool: 0xF9 };
    let new = frames(&reference_calibration(), 1, key().key(), addresses).unwrap();
    let before = run(TestFlash::new(), None, power_on(), Vec::new(), NOT_BUSY, 1_000);
    let now = || Micros(Instant::now().as_micros());
    assert_eq!(before.controller.output(now()), Err(NoEstimate::NoCalibration));
    assert_eq!(before.controller.calibration().map(|c| c.source), Some(CalibrationSource::None));
    let updated = run(before.flash, None, power_on(), new, NOT_BUSY, 8_000);
    let crc = crc_of(&record_of(&reference_calibration()));
    assert_eq!(
        updated.tool.answers.last(),
        Some(&UpdateAnswer::Committed { crc }),
        "{:?}",
        updated.tool.answers.last()
    );
    assert!(updated.controller.output(now()).is_ok());
    let later = run(updated.flash, None, power_on(), Vec::new(), NOT_BUSY, 200);
    assert!(later.controller.output(now()).is_ok());
    assert_eq!(
        later.controller.calibration().map(|c| (c.source, c.crc)),
        Some((CalibrationSource::Stored, crc))
    );
}

#[test]
fn a_calibration_not_yet_handed_to_the_estimator_is_not_overwritten_by_pending_records() {
    let _guard = clock();
    let addresses = Addresses { controller: 0x8C, tool: 0xF9 };
    let new = frames(&reference_calibration(), 1, key().key(), addresses).unwrap();
    // The update ends at 4 s; bus silence, a fault to be written, comes at 9 s; the estimator is polled again at 12 s.
    let run = run_with_pause(TestFlash::new(), None, power_on(), new, NOT_BUSY, 14_000, 2_400..12_000);
    let crc = crc_of(&record_of(&reference_calibration()));
    assert_eq!(run.tool.answers.last(), Some(&UpdateAnswer::Committed { crc }));
    let in_use = run.controller.calibration().map(|c| (c.source, c.crc));
    assert_eq!(in_use, Some((CalibrationSource::Stored, crc)));
    assert!(run.controller.output(Micros(Instant::now().as_micros())).is_ok());
    let stored = read::<FaultMemory>(&run.flash).unwrap();
    assert!(stored.get(FaultCode::BusSilent).is_some(), "written a cycle later: {stored:?}");
}

#[test]
fn a_rejected_stored_calibration_is_a_diagnostic_fault_and_other_records_are_still_written() {
    let _guard = clock();
    // Intact, but with a field out of range, as after a firmware update with narrower ranges.
    let mut calibration = reference_calibration();
    calibration.law.c = 1000.0;
    let record = record_of(&calibration);
    let flash = with_records(async |store| {
        store.write(&StoredCalibration { counter: 3, record: &record }).await.unwrap();
    });
    let run = run(flash, None, power_on(), Vec::new(), NOT_BUSY, 9_000);
    assert_eq!(run.controller.calibration().map(|c| c.source), Some(CalibrationSource::None));
    let stored = read::<FaultMemory>(&run.flash).expect("diagnostic faults are stored");
    assert!(stored.get(FaultCode::CalibrationLost).is_some(), "{stored:?}");
    let hours = read::<OperatingCounters>(&run.flash).unwrap();
    assert!(hours.operating_s >= 5, "{hours:?}");
}

#[test]
fn a_panic_is_recorded_with_its_message_and_operating_hours_continue() {
    let _guard = clock();
    let first = run(TestFlash::new(), None, power_on(), Vec::new(), NOT_BUSY, 9_000);
    let hours = read::<OperatingCounters>(&first.flash).unwrap();
    assert!(
        (hours.starts, hours.unplanned_resets) == (1, 0) && (5..=9).contains(&hours.operating_s),
        "{hours:?}"
    );
    let text = "index out of bounds at src/x.rs:12";
    let crash_record =
        CrashRecord { kind: CrashKind::Panic, text: heapless::String::try_from(text).unwrap() };
    // The hardware reports a requested reset.
    let begin = StartReason { cause: ResetCause::Software, crash_record: Some(crash_record) };
    let second = run(first.flash, None, begin, Vec::new(), NOT_BUSY, 9_000);
    let life = read::<OperatingCounters>(&second.flash).unwrap();
    assert_eq!((life.starts, life.unplanned_resets, life.last_reset), (2, 1, ResetCause::Panic));
    assert!(life.operating_s >= hours.operating_s + 5, "{life:?}");
    let stop = read::<CrashReport>(&second.flash).unwrap();
    assert_eq!((stop.crash.text.as_str(), stop.operating_s), (text, hours.operating_s));
    let faults = read::<FaultMemory>(&second.flash).unwrap();
    let entry = faults.get(FaultCode::Panic).expect("it is in the fault memory");
    assert_eq!((entry.active, entry.first.operating_s), (false, hours.operating_s));
    // Faults of the start before are kept: the converter that does not answer occurs in both.
    let twice = faults.entries().iter().filter(|entry| entry.occurrences == 2).count();
    assert!(twice >= 3, "{faults:?}");
}

#[test]
fn a_failing_flash_is_a_diagnostic_fault_and_estimates_continue() {
    let _guard = clock();
    let mut flash = TestFlash::new();
    flash.cut_after(0, Torn::Clean);
    let default = record_of(&reference_calibration());
    let after = run(flash, Some(&default), power_on(), Vec::new(), NOT_BUSY, 6_000);
    assert!(after.controller.output(Micros(Instant::now().as_micros())).is_ok());
    let is_active = after
        .controller
        .faults(|memory| memory.active().any(|entry| entry.code() == Some(FaultCode::StorageFailed)));
    assert!(is_active);
    let [_, estimate, ..] = after.controller.task_stats.read();
    assert_eq!((estimate.cycles, estimate.missed), (599, 0));
}

#[test]
fn missed_deadlines_are_a_diagnostic_fault() {
    let _guard = clock();
    let late = run(TestFlash::new(), None, power_on(), Vec::new(), Duration::from_millis(4), 7_000);
    let faults = read::<FaultMemory>(&late.flash);
    let in_memory = late.controller.faults(|memory| memory.get(FaultCode::Overrun).is_some());
    assert!(in_memory, "{faults:?}");
    let (_, in_time) = (drop(late), run(TestFlash::new(), None, power_on(), Vec::new(), NOT_BUSY, 7_000));
    assert!(in_time.controller.faults(|memory| memory.get(FaultCode::Overrun).is_none()));
}
