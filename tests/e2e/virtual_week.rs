//! The controller's tasks in simulated time on the host: no deadline missed and no resource leaked over a week.
//!
//! The test drives the clock. A minute of driving is simulated once by the parts of the closed loop and repeated, with continuing
//! edge time stamps. An hour runs with every test run; the week, 604.8 million milliseconds and 60 million estimates, is
//! marked `#[ignore]`: `cargo test --release -p kou-tests --test virtual_week -- --ignored --nocapture`.

use std::cell::{Cell, RefCell};
use std::future::Future;
use std::path::Path;
use std::pin::Pin;
use std::task::{Context, Waker};

use embassy_futures::block_on;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_time::{Duration, Instant, MockDriver};
use host_sim::pil::plant::{Scenario, SensorEmulator, Vehicle};
use kou_app::controller::{
    CanInterface, CanPort, Controller, Estimator, FrontEnd, NoEstimate, Publish, SensorsMemory, StartReason,
    StorageTask, Task, Watchdog, WriteScheduleConfig, WriteScheduleParams, run_estimate, run_publish,
    run_sample, run_storage, run_supervise,
};
use kou_app::diagnostics::FaultMemory;
use kou_app::diagnostics::ResetCause;
use kou_app::j1939::{Frame, Name, NameConfig, Node};
use kou_app::sensors::adc::{AdcCounts, ConversionError, Input, request};
use kou_app::sensors::set::{CHANNELS, SensorInputs, SensorsParams};
use kou_app::sensors::wiring;
use kou_app::storage::{HealthRecord, OperatingCounters, Store};
use kou_app::update::{NoKey, UpdateService, UpdateSession};
use kou_emulation::RamFlash;
use kou_emulation::{FLASH_LEN, FLASH_PAGE};
use kou_estimator::units::Micros;
use kou_estimator::{Estimate, Sample};
use kou_lumped::machine::Machine;
use kou_records::TomlFile;
use kou_tests::{record_of, reference_calibration};

/// One minute, with idling, partial and reversed displacement, and a failing sensor.
const MINUTE: &str = "schema = 1\nname = 'minute'\nseed = 3\nvehicle = 'surrogate'\nduration_s = 60.0\n\
    [[failure]]\nsensor = 'oil'\nkind = 'open'\nfrom_s = 40.0\nuntil_s = 42.0\n";
const POINTS: [[f64; 4]; 9] = [
    [0.0, 1500.0, 0.0, 900.0],
    [2.0, 1500.0, 0.0, 900.0],
    [3.0, 1500.0, 1.0, 900.0],
    [20.0, 2200.0, 1.0, 1300.0],
    [21.0, 2200.0, 0.5, 1300.0],
    [30.0, 1800.0, 0.5, 800.0],
    [32.0, 1800.0, -0.7, 800.0],
    [57.0, 1500.0, -0.7, 900.0],
    [59.0, 1500.0, 0.0, 900.0],
];

/// Counts of the stamping timer in a minute.
const COUNTS: u32 = 600_000_000;

fn minute() -> Vec<SensorInputs> {
    let points = POINTS.map(|[time_s, n, alpha, load]| {
        format!("[[at]]\ntime_s = {time_s}\nn_p_rpm = {n}\nalpha = {alpha}\nload_nm = {load}\nt_b_c = 60.0\n")
    });
    let text = format!("{MINUTE}{}", points.concat());
    let scenario =
        Scenario::from_toml(&TomlFile::from_text(Path::new("minute.toml"), text).expect("it is TOML"))
            .expect("it is a scenario");
    let machine =
        Machine::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../host-sim/machines/reference.toml"))
            .expect("the reference machine is shipped");
    let mut vehicle = Vehicle::new(&machine, &reference_calibration(), &scenario).expect("it has a motor");
    let mut parts = SensorEmulator::new(&scenario);
    (1..=60_000_u32)
        .map(|ms| {
            let time_s = f64::from(ms) * 1e-3;
            let truth = vehicle.millisecond(&scenario.command(time_s)).expect("the surrogate never gives up");
            let signals = parts.millisecond(time_s, &truth);
            let mut inputs = SensorInputs::new();
            for (number, conversion) in (0..).zip(&mut inputs.analog) {
                let [_, high, low] = signals.answer(request(Input::new(number).expect("below eight")));
                *conversion =
                    AdcCounts::new(u16::from_be_bytes([high & 0x0F, low])).ok_or(ConversionError::NoAnswer);
            }
            inputs.count = signals.count;
            for (edges, stamps) in [(&mut inputs.pump, &signals.pump), (&mut inputs.motor, &signals.motor)] {
                for &stamp in stamps {
                    edges.push(stamp);
                }
            }
            inputs
        })
        .collect()
}

/// Front end that repeats a minute of inputs.
struct MinuteReplay<'a> {
    minute: &'a [SensorInputs],
    at: usize,
    offset: u32,
}

impl FrontEnd for MinuteReplay<'_> {
    async fn read(&mut self, _: &[Option<Input>; CHANNELS], into: &mut SensorInputs) {
        let now = &self.minute[self.at];
        into.analog = now.analog;
        into.count = now.count.wrapping_add(self.offset);
        for (to, from) in [(&mut into.pump, &now.pump), (&mut into.motor, &now.motor)] {
            to.clear();
            for &stamp in from.stamps() {
                to.push(stamp.wrapping_add(self.offset));
            }
        }
        self.at += 1;
        if self.at == self.minute.len() {
            self.at = 0;
            self.offset = self.offset.wrapping_add(COUNTS);
        }
    }
}

/// Counts of estimates, and calls of the watchdog.
#[derive(Default)]
struct EstimateCounts {
    valid: Cell<u64>,
    invalid: Cell<u64>,
    none: Cell<u64>,
    fed: Cell<u64>,
    given_up: RefCell<Vec<Task>>,
}

fn raise(count: &Cell<u64>) {
    count.set(count.get() + 1);
}

/// A bus without other nodes.
struct EmptyBus;

impl CanPort for EmptyBus {
    fn receive(&mut self) -> Option<Frame> {
        None
    }

    fn send(&mut self, _: &Frame) -> bool {
        true
    }
}

/// Publisher that counts estimates before it sends them.
struct CountingPublisher<'a> {
    counts: &'a EstimateCounts,
    bus: CanInterface<'a, EmptyBus, NoopRawMutex>,
}

impl Publish for CountingPublisher<'_> {
    async fn publish(
        &mut self,
        now: Micros,
        estimate: &Result<Estimate, NoEstimate>,
        sample: Option<&Sample>,
    ) {
        match estimate {
            Ok(estimate) if estimate.observed.is_ok() => raise(&self.counts.valid),
            Ok(_) => raise(&self.counts.invalid),
            Err(_) => raise(&self.counts.none),
        }
        self.bus.publish(now, estimate, sample).await;
    }
}

impl Watchdog for &EstimateCounts {
    fn feed(&mut self) {
        raise(&self.fed);
    }

    fn give_up(&mut self, task: Task) {
        self.given_up.borrow_mut().push(task);
    }
}

fn drive(minutes: u64) {
    let minute = minute();
    let clock = MockDriver::get();
    clock.reset();
    let controller = Controller::<NoopRawMutex>::new();
    let default = record_of(&reference_calibration());
    let flash = RamFlash::<FLASH_LEN, FLASH_PAGE>::new();
    let mut session = UpdateSession::new();
    let mut store = Store::new(flash, 0..FLASH_LEN as u32).expect("the region can be used");
    let rates = WriteScheduleParams::new(&WriteScheduleConfig::VEHICLE).expect("the rates make sense");
    let begin = StartReason { cause: ResetCause::PowerOn, crash_record: None };
    let mut storage_task =
        StorageTask::new(UpdateService::new(&mut store, &mut session, NoKey, Some(&default)), rates, begin);
    let params = SensorsParams::new(&wiring::REFERENCE).expect("the reference wiring is sound");
    let counts = EstimateCounts::default();
    let start = Instant::now();
    let (c, params, s, minute, k) = (&controller, &params, &counts, minute.as_slice(), &mut storage_task);
    let mut tasks: [Pin<Box<dyn Future<Output = ()> + '_>>; 5] = [
        Box::pin(async move {
            run_sample(
                c,
                start,
                params,
                &mut MinuteReplay { minute, at: 0, offset: 0 },
                &mut SensorsMemory::new(),
            )
            .await;
        }),
        Box::pin(async move { run_estimate(c, start, &mut Estimator::new()).await }),
        Box::pin(async move {
            let name = Name::new(&NameConfig::transmission(1)).expect("the name is sound");
            let bus = CanInterface::new(EmptyBus, Node::new(name, 0x8C), c);
            run_publish(c, start, &mut CountingPublisher { counts: s, bus }).await;
        }),
        Box::pin(async move { run_storage(c, start, k).await }),
        Box::pin(async move { run_supervise(c, start, &mut &*s).await }),
    ];
    let mut context = Context::from_waker(Waker::noop());
    let mut poll = || {
        for task in &mut tasks {
            assert!(task.as_mut().poll(&mut context).is_pending(), "a task has ended");
        }
    };
    poll();
    let milliseconds = minutes * 60_000;
    for _ in 0..milliseconds {
        clock.advance(Duration::from_millis(1));
        poll();
    }
    let task_stats = controller.task_stats.read();
    let cycles = [1, 10, 10, 1000, 50].map(|period| (milliseconds / period) as u32);
    // Turns wrap at 2^32, which a week at 1 kHz does not reach.
    assert_eq!(task_stats.map(|stats| stats.cycles), cycles);
    for stats in task_stats {
        assert_eq!((stats.missed, stats.skipped, stats.max_jitter_us), (0, 0, 0), "{stats:?}");
    }
    let (valid, invalid, none) = (counts.valid.get(), counts.invalid.get(), counts.none.get());
    println!("{milliseconds} ms: {valid} estimates valid, {invalid} with a reason, {none} none");
    assert_eq!(valid + invalid + none, milliseconds / 10);
    assert_eq!(counts.fed.get(), milliseconds / 50);
    assert!(counts.given_up.borrow().is_empty());
    // Each minute is like the first: some 48 s of it are driven with every sensor in order, the rest has its reason.
    assert!(valid > milliseconds / 10 * 7 / 10 && invalid > milliseconds / 10 / 20, "{valid} {invalid}");
    assert!(none <= 2, "{none}");
    assert_eq!((Instant::now() - start).as_millis(), milliseconds);
    drop(tasks);
    check_flash(&mut storage_task, &controller, minutes);
}

/// Checks the records in flash and the wear of the flash.
fn check_flash(
    storage_task: &mut StorageTask<'_, RamFlash<FLASH_LEN, FLASH_PAGE>, NoKey>,
    controller: &Controller<NoopRawMutex>,
    minutes: u64,
) {
    let store = storage_task.service().store();
    let (life, health, faults) = block_on(async {
        let life = store.read::<OperatingCounters>().await.expect("readable").expect("written");
        let health = store.read::<HealthRecord>().await.expect("readable").expect("written");
        (life, health, store.read::<FaultMemory>().await.expect("readable").expect("written"))
    });
    // Written every ten minutes, one record a second: the last one is at most that old.
    let seconds = u32::try_from(60 * minutes).expect("a week fits");
    assert!(life.operating_s <= seconds && life.operating_s + 610 > seconds, "{life:?}");
    assert_eq!((life.starts, life.unplanned_resets), (1, 0));
    assert!(health.state.is_sound());
    // The oil sensor fails in every minute; what is in flash is at most the schedule's ten minutes behind.
    let oil =
        |memory: &FaultMemory| memory.entries().iter().map(|entry| entry.occurrences).max().unwrap_or(0);
    let now = controller.faults(|memory| oil(memory));
    assert!(oil(&faults) == 126 || oil(&faults) + 11 >= now, "{} of {now}", oil(&faults));
    let (worked, erasures) = (store.flash().worked(), store.flash().erasures());
    let hours = minutes as f64 / 60.0;
    // 10 000 erasures of each page is what the chip is rated for.
    let lifetime_h = 10_000.0 * (FLASH_LEN / FLASH_PAGE) as f64 * hours / (erasures.max(1) as f64);
    println!(
        "{hours} h: {worked} bytes written, {erasures} pages erased: the flash lasts {lifetime_h:.0} h of this"
    );
    // Ten years of two thousand hours, with a sensor that fails every minute.
    assert!(lifetime_h > 20_000.0, "{lifetime_h}");
}

#[test]
fn an_hour_of_drive_in_virtual_time_misses_nothing() {
    drive(60);
}

/// A seventh of the week, for shorter runs.
#[test]
#[ignore = "a day of drive in virtual time takes a minute; see the head of this file"]
fn a_day_of_drive_in_virtual_time_misses_nothing() {
    drive(24 * 60);
}

#[test]
#[ignore = "a week of drive in virtual time takes minutes; see the head of this file"]
fn a_week_of_drive_in_virtual_time_misses_nothing() {
    drive(7 * 24 * 60);
}
