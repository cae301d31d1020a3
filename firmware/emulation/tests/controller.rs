//! The controller's tasks on the host, with a clock that only the test moves.

use std::cell::{Cell, RefCell};
use std::future::Future;
use std::pin::Pin;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::task::{Context, Waker};

use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_time::{Duration, Instant, MockDriver};
use kou_app::controller::{
    Controller, Estimator, FrontEnd, NoEstimate, Publish, SUPERVISE_PERIOD, SensorsMemory, StartReason,
    StorageTask, Task, Watchdog, WriteScheduleConfig, WriteScheduleParams, run_estimate, run_publish,
    run_sample, run_storage, run_supervise,
};
use kou_app::diagnostics::ResetCause;
use kou_app::sensors::adc::{AdcCounts, ConversionError, Input};
use kou_app::sensors::set::{CHANNELS, SensorInputs, SensorsParams};
use kou_app::sensors::wiring;
use kou_app::storage::{MIN_BYTES, Store};
use kou_app::update::{NoKey, UpdateService, UpdateSession};
use kou_emulation::RamFlash;
use kou_estimator::units::Micros;
use kou_estimator::{Estimate, Sample};

/// The mocked clock is shared by the whole process: a test that uses it locks it until its end.
fn clock_for_one_test() -> MutexGuard<'static, ()> {
    static CLOCK: Mutex<()> = Mutex::new(());
    let guard = CLOCK.lock().unwrap_or_else(PoisonError::into_inner);
    MockDriver::get().reset();
    guard
}

type Tasks<'a> = Vec<Pin<Box<dyn Future<Output = ()> + 'a>>>;

/// Polls every task until none can proceed at this time.
fn settle(tasks: &mut Tasks<'_>) {
    let mut context = Context::from_waker(Waker::noop());
    for task in tasks {
        assert!(task.as_mut().poll(&mut context).is_pending(), "a task has ended");
    }
}

/// Advances the clock by single milliseconds.
fn run(clock: &MockDriver, tasks: &mut Tasks<'_>, ms: u64) {
    for _ in 0..ms {
        clock.advance(Duration::from_millis(1));
        settle(tasks);
    }
}

/// Front end with fixed inputs; `busy` is the duration of a read.
struct MockFrontEnd<'a> {
    counts: &'a Cell<Result<AdcCounts, ConversionError>>,
    busy: &'a Cell<Duration>,
}

impl FrontEnd for MockFrontEnd<'_> {
    async fn read(&mut self, wanted: &[Option<Input>; CHANNELS], into: &mut SensorInputs) {
        MockDriver::get().advance(self.busy.get());
        assert_eq!(wanted.iter().flatten().count(), CHANNELS);
        into.analog = [self.counts.get(); CHANNELS];
        into.count = (Instant::now().as_micros() * 10) as u32;
    }
}

#[derive(Default)]
struct RecordingPublisher(RefCell<Vec<Result<Estimate, NoEstimate>>>);

impl Publish for &RecordingPublisher {
    async fn publish(&mut self, _: Micros, estimate: &Result<Estimate, NoEstimate>, _: Option<&Sample>) {
        self.0.borrow_mut().push(*estimate);
    }
}

#[derive(Default)]
struct RecordingWatchdog {
    fed_at_ms: Cell<u64>,
    given_up: RefCell<Vec<Task>>,
}

impl Watchdog for &RecordingWatchdog {
    fn feed(&mut self) {
        self.fed_at_ms.set(Instant::now().as_millis());
    }

    fn give_up(&mut self, task: Task) {
        self.given_up.borrow_mut().push(task);
    }
}

/// State of a run that outlives its tasks.
struct TaskBench {
    controller: Controller<NoopRawMutex>,
    params: SensorsParams,
    counts: Cell<Result<AdcCounts, ConversionError>>,
    busy: Cell<Duration>,
    published: RecordingPublisher,
    watchdog: RecordingWatchdog,
}

impl TaskBench {
    fn new() -> Self {
        Self {
            controller: Controller::new(),
            params: SensorsParams::new(&wiring::REFERENCE).unwrap(),
            counts: Cell::new(Ok(AdcCounts::new(1500).unwrap())),
            busy: Cell::new(Duration::from_ticks(0)),
            published: RecordingPublisher::default(),
            watchdog: RecordingWatchdog::default(),
        }
    }

    /// Tasks in the order of their priorities, without the excluded ones.
    fn tasks(&self, without: &[Task]) -> Tasks<'_> {
        let start = Instant::now();
        let c = &self.controller;
        let mut tasks: Tasks<'_> = Vec::new();
        let with = |task| !without.contains(&task);
        if with(Task::Sample) {
            tasks.push(Box::pin(async move {
                let mut front_end = MockFrontEnd { counts: &self.counts, busy: &self.busy };
                run_sample(c, start, &self.params, &mut front_end, &mut SensorsMemory::new()).await;
            }));
        }
        if with(Task::Estimate) {
            tasks.push(Box::pin(async move { run_estimate(c, start, &mut Estimator::new()).await }));
        }
        if with(Task::Publish) {
            tasks.push(Box::pin(async move { run_publish(c, start, &mut &self.published).await }));
        }
        if with(Task::Storage) {
            tasks.push(Box::pin(async move {
                let mut store =
                    Store::new(RamFlash::<{ MIN_BYTES as usize }, 2048>::new(), 0..MIN_BYTES).unwrap();
                let rates = WriteScheduleParams::new(&WriteScheduleConfig::VEHICLE).unwrap();
                let mut session = UpdateSession::new();
                let begin = StartReason { cause: ResetCause::PowerOn, crash_record: None };
                let mut storage =
                    StorageTask::new(UpdateService::new(&mut store, &mut session, NoKey, None), rates, begin);
                run_storage(c, start, &mut storage).await;
            }));
        }
        tasks.push(Box::pin(async move { run_supervise(c, start, &mut &self.watchdog).await }));
        settle(&mut tasks);
        tasks
    }
}

#[test]
fn every_task_meets_its_period_and_the_watchdog_is_fed() {
    let _clock = clock_for_one_test();
    let bench = TaskBench::new();
    let mut tasks = bench.tasks(&[]);
    let clock = MockDriver::get();
    run(clock, &mut tasks, 10_000);
    let [sample, estimate, publish, store, supervise] = bench.controller.task_stats.read();
    let cycles = [sample, estimate, publish, store, supervise].map(|stats| stats.cycles);
    assert_eq!(cycles, [10_000, 1_000, 1_000, 10, 200]);
    for stats in bench.controller.task_stats.read() {
        assert_eq!((stats.missed, stats.skipped, stats.max_jitter_us), (0, 0, 0));
    }
    assert_eq!(bench.published.0.borrow().len(), 1_000);
    assert_eq!(Instant::now().as_millis() - bench.watchdog.fed_at_ms.get(), 0);
    assert_eq!(*bench.watchdog.given_up.borrow(), []);
}

#[test]
fn without_a_calibration_the_output_says_so_and_is_never_an_estimate() {
    let _clock = clock_for_one_test();
    let bench = TaskBench::new();
    assert_eq!(bench.controller.output(Micros(0)), Err(NoEstimate::Starting));
    let mut tasks = bench.tasks(&[]);
    run(MockDriver::get(), &mut tasks, 1_000);
    // Unknown until the flash has been read.
    let published = bench.published.0.borrow();
    let starting = published.iter().take_while(|published| **published == Err(NoEstimate::Starting)).count();
    assert!(starting <= 2, "{starting}");
    assert!(published.iter().skip(starting).all(|published| *published == Err(NoEstimate::NoCalibration)));
    let sample = bench.controller.sample().unwrap();
    assert!(sample.oil_temperature.value.is_ok(), "{sample:?}");
}

#[test]
fn deadlines_missed_by_a_late_task_are_counted_and_its_schedule_does_not_drift() {
    let _clock = clock_for_one_test();
    let bench = TaskBench::new();
    let mut tasks = bench.tasks(&[]);
    let clock = MockDriver::get();
    run(clock, &mut tasks, 100);
    // One read takes 3.5 ms: the cycles due 1, 2 and 3 ms after it are skipped.
    bench.busy.set(Duration::from_micros(3_500));
    run(clock, &mut tasks, 1);
    bench.busy.set(Duration::from_ticks(0));
    let stats = bench.controller.task_stats.sample.read();
    assert_eq!((stats.cycles, stats.missed, stats.skipped, stats.max_execution_us), (101, 1, 3, 3_500));
    // The clock is now at half a millisecond; cycles remain on whole ones.
    clock.advance(Duration::from_micros(500));
    settle(&mut tasks);
    run(clock, &mut tasks, 100);
    let after = bench.controller.task_stats.sample.read();
    assert_eq!((after.cycles, after.missed, after.max_jitter_us), (202, 1, 0));
    // No drift: executed and skipped cycles equal the elapsed milliseconds.
    assert_eq!(u64::from(after.cycles + after.skipped), 100 + 1 + 4 + 100);
}

#[test]
fn each_stopped_task_starves_the_watchdog_in_time_and_is_named() {
    let _clock = clock_for_one_test();
    for task in Task::ALL {
        let bench = TaskBench::new();
        let mut tasks = bench.tasks(&[task]);
        let clock = MockDriver::get();
        let start = Instant::now();
        // Its timeout, one period of the supervisor to detect it and one more to give up.
        let limit = task.timeout() + SUPERVISE_PERIOD * 3;
        run(clock, &mut tasks, limit.as_millis());
        assert_eq!(*bench.watchdog.given_up.borrow(), [task], "{task:?}");
        let fed = bench.watchdog.fed_at_ms.get().saturating_sub(start.as_millis());
        assert!(fed <= (task.timeout() + SUPERVISE_PERIOD).as_millis(), "{task:?}: fed until {fed} ms");
        // Permanently.
        let fed = bench.watchdog.fed_at_ms.get();
        run(clock, &mut tasks, 2_000);
        assert_eq!(bench.watchdog.fed_at_ms.get(), fed);
        assert_eq!(bench.watchdog.given_up.borrow().len(), 1);
    }
}
