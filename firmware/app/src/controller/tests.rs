//! The controller's tasks on the host, with a clock that only the test moves.

use core::future::Future;
use core::pin::{Pin, pin};
use core::task::{Context, Waker};
use std::boxed::Box;
use std::cell::{Cell, RefCell};
use std::vec;
use std::vec::Vec;

use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_time::{Duration, Instant, MockDriver};
use kou_estimator::units::Micros;
use kou_estimator::{Estimate, Fault, Reason, Sample};
use proptest::prelude::*;

use super::note::{self, Kind};
use super::*;
use crate::faults::Code;
use crate::j1939::{Frame, Id, Name, NameConfig, Node};
use crate::sensors::adc::{Counts, Input, NoCounts};
use crate::sensors::set::{CHANNELS, Inputs, SensorsParams};
use crate::sensors::wiring;
use crate::storage::{MIN_BYTES, RamFlash, ResetCause, Store};
use crate::update::{NoKey, Service, Session};

type Tasks<'a> = Vec<Pin<Box<dyn Future<Output = ()> + 'a>>>;

/// Polls every task until none has anything left to do at this time.
fn settle(tasks: &mut Tasks<'_>) {
    let mut context = Context::from_waker(Waker::noop());
    for task in tasks {
        assert!(task.as_mut().poll(&mut context).is_pending(), "a task has ended");
    }
}

/// Moves the clock by single milliseconds.
fn run(clock: &MockDriver, tasks: &mut Tasks<'_>, ms: u64) {
    for _ in 0..ms {
        clock.advance(Duration::from_millis(1));
        settle(tasks);
    }
}

/// A front end whose inputs are what a cell says; `busy` is time that a read takes.
struct Bench<'a> {
    counts: &'a Cell<Result<Counts, NoCounts>>,
    busy: &'a Cell<Duration>,
}

impl FrontEnd for Bench<'_> {
    async fn read(&mut self, wanted: &[Option<Input>; CHANNELS], into: &mut Inputs) {
        MockDriver::get().advance(self.busy.get());
        assert_eq!(wanted.iter().flatten().count(), CHANNELS);
        into.analog = [self.counts.get(); CHANNELS];
        into.count = (Instant::now().as_micros() * 10) as u32;
    }
}

#[derive(Default)]
struct Told(RefCell<Vec<Result<Estimate, NoEstimate>>>);

impl Publish for &Told {
    async fn publish(&mut self, _: Micros, estimate: &Result<Estimate, NoEstimate>, _: Option<&Sample>) {
        self.0.borrow_mut().push(*estimate);
    }
}

#[derive(Default)]
struct Dog {
    fed_at_ms: Cell<u64>,
    given_up: RefCell<Vec<Task>>,
}

impl Watchdog for &Dog {
    fn feed(&mut self) {
        self.fed_at_ms.set(Instant::now().as_millis());
    }

    fn give_up(&mut self, task: Task) {
        self.given_up.borrow_mut().push(task);
    }
}

/// Everything that a run needs; all of it outlives the tasks.
struct World {
    controller: Controller<NoopRawMutex>,
    params: SensorsParams,
    counts: Cell<Result<Counts, NoCounts>>,
    busy: Cell<Duration>,
    told: Told,
    dog: Dog,
}

impl World {
    fn new() -> Self {
        Self {
            controller: Controller::new(),
            params: SensorsParams::new(&wiring::REFERENCE).unwrap(),
            counts: Cell::new(Ok(Counts::new(1500).unwrap())),
            busy: Cell::new(Duration::from_ticks(0)),
            told: Told::default(),
            dog: Dog::default(),
        }
    }

    /// All tasks but those that are left out, in the order of their priorities.
    fn tasks(&self, without: &[Task]) -> Tasks<'_> {
        let start = Instant::now();
        let c = &self.controller;
        let mut tasks: Tasks<'_> = Vec::new();
        let with = |task| !without.contains(&task);
        if with(Task::Sample) {
            tasks.push(Box::pin(async move {
                let mut bench = Bench { counts: &self.counts, busy: &self.busy };
                run_sample(c, start, &self.params, &mut bench, &mut SensorsMemory::new()).await;
            }));
        }
        if with(Task::Estimate) {
            tasks.push(Box::pin(async move { run_estimate(c, start, &mut Estimator::new()).await }));
        }
        if with(Task::Publish) {
            tasks.push(Box::pin(async move { run_publish(c, start, &mut &self.told).await }));
        }
        if with(Task::Store) {
            tasks.push(Box::pin(async move {
                let mut store =
                    Store::new(RamFlash::<{ MIN_BYTES as usize }, 2048>::new(), 0..MIN_BYTES).unwrap();
                let rates = KeepParams::new(&KeepConfig::VEHICLE).unwrap();
                let mut session = Session::new();
                let begin = Begin { cause: ResetCause::PowerOn, note: None };
                let mut keeper =
                    Keeper::new(Service::new(&mut store, &mut session, NoKey, None), rates, begin);
                run_store(c, start, &mut keeper).await;
            }));
        }
        tasks.push(Box::pin(async move { run_supervise(c, start, &mut &self.dog).await }));
        settle(&mut tasks);
        tasks
    }
}

#[test]
fn every_task_keeps_its_period_and_the_watchdog_is_fed() {
    let _clock = crate::clock_for_one_test();
    let world = World::new();
    let mut tasks = world.tasks(&[]);
    let clock = MockDriver::get();
    run(clock, &mut tasks, 10_000);
    let [sample, estimate, publish, store, supervise] = world.controller.vitals.read();
    let turns = [sample, estimate, publish, store, supervise].map(|vital| vital.turns);
    assert_eq!(turns, [10_000, 1_000, 1_000, 10, 200]);
    for vital in world.controller.vitals.read() {
        assert_eq!((vital.missed, vital.skipped, vital.latest_us), (0, 0, 0));
    }
    assert_eq!(world.told.0.borrow().len(), 1_000);
    assert_eq!(Instant::now().as_millis() - world.dog.fed_at_ms.get(), 0);
    assert_eq!(*world.dog.given_up.borrow(), []);
}

#[test]
fn without_a_calibration_the_output_says_so_and_never_an_estimate() {
    let _clock = crate::clock_for_one_test();
    let world = World::new();
    assert_eq!(world.controller.output(Micros(0)), Err(NoEstimate::Starting));
    let mut tasks = world.tasks(&[]);
    run(MockDriver::get(), &mut tasks, 1_000);
    // Until the flash has been read it is not known.
    let told = world.told.0.borrow();
    let starting = told.iter().take_while(|told| **told == Err(NoEstimate::Starting)).count();
    assert!(starting <= 2, "{starting}");
    assert!(told.iter().skip(starting).all(|told| *told == Err(NoEstimate::NoCalibration)));
    let sample = world.controller.sample().unwrap();
    assert!(sample.oil_temperature.value.is_ok(), "{sample:?}");
}

#[test]
fn a_late_task_misses_is_counted_and_does_not_shift_the_ones_after_it() {
    let _clock = crate::clock_for_one_test();
    let world = World::new();
    let mut tasks = world.tasks(&[]);
    let clock = MockDriver::get();
    run(clock, &mut tasks, 100);
    // One read takes 3.5 ms: the turns due 1, 2 and 3 ms after it are left out.
    world.busy.set(Duration::from_micros(3_500));
    run(clock, &mut tasks, 1);
    world.busy.set(Duration::from_ticks(0));
    let vital = world.controller.vitals.sample.read();
    assert_eq!((vital.turns, vital.missed, vital.skipped, vital.longest_us), (101, 1, 3, 3_500));
    // The clock now stands at half a millisecond; the turns stay on the whole ones.
    clock.advance(Duration::from_micros(500));
    settle(&mut tasks);
    run(clock, &mut tasks, 100);
    let after = world.controller.vitals.sample.read();
    assert_eq!((after.turns, after.missed, after.latest_us), (202, 1, 0));
    // No time has leaked: turns and left-out turns are the milliseconds that have passed.
    assert_eq!(u64::from(after.turns + after.skipped), 100 + 1 + 4 + 100);
}

#[test]
fn jitter_is_the_longest_wait_from_due_to_begun() {
    let _clock = crate::clock_for_one_test();
    let vitals = Vitals::new();
    let clock = MockDriver::get();
    let mut pace = Pace::new(Instant::now(), Duration::from_millis(10), &vitals.publish);
    for late_us in [0, 250, 40] {
        let mut turn = pin!(pace.turn());
        let mut context = Context::from_waker(Waker::noop());
        assert!(turn.as_mut().poll(&mut context).is_pending());
        let to_due = 10_000 - Instant::now().as_micros() % 10_000;
        clock.advance(Duration::from_micros(to_due + late_us));
        assert!(turn.as_mut().poll(&mut context).is_ready());
    }
    assert_eq!(vitals.publish.read().latest_us, 250);
}

#[test]
fn each_task_that_stops_starves_the_watchdog_in_time_and_is_named() {
    let _clock = crate::clock_for_one_test();
    for task in Task::ALL {
        let world = World::new();
        let mut tasks = world.tasks(&[task]);
        let clock = MockDriver::get();
        let start = Instant::now();
        // Within its patience, one look of the supervisor to notice and one more to give up.
        let limit = task.patience() + SUPERVISE_PERIOD * 3;
        run(clock, &mut tasks, limit.as_millis());
        assert_eq!(*world.dog.given_up.borrow(), [task], "{task:?}");
        let fed = world.dog.fed_at_ms.get().saturating_sub(start.as_millis());
        assert!(fed <= (task.patience() + SUPERVISE_PERIOD).as_millis(), "{task:?}: fed until {fed} ms");
        // For good.
        let fed = world.dog.fed_at_ms.get();
        run(clock, &mut tasks, 2_000);
        assert_eq!(world.dog.fed_at_ms.get(), fed);
        assert_eq!(world.dog.given_up.borrow().len(), 1);
    }
}

#[test]
fn a_sampling_task_that_stops_makes_the_estimates_stale_and_a_stopped_estimate_is_late() {
    let _clock = crate::clock_for_one_test();
    let world = World::new();
    let good = Sample::empty(Micros(Instant::now().as_micros()));
    world.controller.set_sample(good);
    // The estimate is made of the old sample, and says which reading is missing; it is not repeated for ever.
    world.controller.set_estimate(
        Micros(1_000),
        Ok(Estimate::invalid(Micros(1_000), Reason::Sensor(kou_estimator::Channel::PumpSpeed, Fault::Stale))),
    );
    assert!(world.controller.output(Micros(101_000)).is_ok());
    assert_eq!(world.controller.output(Micros(101_001)), Err(NoEstimate::Late));
}

/// A bus in memory: what comes, what was sent, and how many more frames there is room for.
struct Line {
    come: Vec<Frame>,
    sent: Vec<Frame>,
    room: usize,
}

impl CanPort for Line {
    fn receive(&mut self) -> Option<Frame> {
        self.come.pop()
    }

    fn send(&mut self, frame: &Frame) -> bool {
        if self.sent.len() >= self.room {
            return false;
        }
        self.sent.push(*frame);
        true
    }
}

type Shared = Controller<NoopRawMutex>;

fn bus(controller: &Shared, room: usize) -> Bus<'_, Line, NoopRawMutex> {
    let name = Name::new(&NameConfig::transmission(1)).unwrap();
    Bus::new(Line { come: Vec::new(), sent: Vec::new(), room }, Node::new(name, 0x8C), controller)
}

fn turn(bus: &mut Bus<'_, Line, NoopRawMutex>, ms: u64, sample: Option<&Sample>) {
    let none = Err(NoEstimate::NoCalibration);
    embassy_futures::block_on(bus.publish(Micros(ms * 1000), &none, sample));
}

#[test]
fn on_the_bus_it_claims_its_address_and_then_tells_also_that_it_has_nothing_to_tell() {
    let controller = Shared::new();
    let mut bus = bus(&controller, usize::MAX);
    for ms in (0..3_000).step_by(10) {
        turn(&mut bus, ms, None);
    }
    let sent = &bus.port().sent;
    assert_eq!(sent.first().map(|frame| frame.id().pgn().get()), Some(60928), "address claimed");
    assert!(sent.len() > 30 && sent.iter().all(|frame| frame.id().source() == 0x8C), "{}", sent.len());
}

#[test]
fn a_failed_sensor_is_an_active_trouble_until_it_heals_and_then_a_previous_one() {
    let controller = Shared::new();
    let mut bus = bus(&controller, usize::MAX);
    let mut sample = Sample::empty(Micros(0));
    sample.pump_speed = kou_estimator::Reading::failed(Micros(0), Fault::Open);
    turn(&mut bus, 0, Some(&sample));
    let code = Code::Sensor(kou_estimator::Channel::PumpSpeed, Fault::Open);
    assert!(controller.faults(|memory| memory.active().any(|entry| entry.code() == Some(code))));
    sample.pump_speed = kou_estimator::Reading::new(Micros(0), kou_estimator::units::RevPerMin(1000.0));
    turn(&mut bus, 10, Some(&sample));
    assert!(controller.faults(|memory| memory.active().all(|entry| entry.code() != Some(code))));
    assert!(controller.faults(|memory| memory.previous().any(|entry| entry.code() == Some(code))));
}

#[test]
fn a_silent_bus_is_a_trouble_after_five_seconds_and_one_frame_heals_it() {
    let controller = Shared::new();
    let mut bus = bus(&controller, usize::MAX);
    let is_active = || controller.faults(|memory| memory.active().any(|e| e.code() == Some(Code::BusSilent)));
    for ms in (0..=5_000).step_by(10) {
        turn(&mut bus, ms, None);
        assert!(!is_active(), "{ms}");
    }
    turn(&mut bus, 5_010, None);
    assert!(is_active());
    bus.port_mut().come.push(Frame::new(Id::from_raw(0x0CF0_0203), [0xFF; 8]));
    turn(&mut bus, 5_020, None);
    assert!(!is_active());
}

#[test]
fn what_the_driver_has_no_room_for_is_counted_and_a_flood_costs_a_bounded_turn() {
    let controller = Shared::new();
    let mut bus = bus(&controller, 1);
    bus.port_mut().come = vec![Frame::new(Id::from_raw(0x18EA_FFF9), [0; 8]); 1000];
    for ms in (0..1_000).step_by(10) {
        let before = bus.port().come.len();
        turn(&mut bus, ms, None);
        assert!(before - bus.port().come.len() <= 32);
    }
    assert_eq!(bus.port().sent.len(), 1);
    assert!(bus.dropped() > 0);
}

#[test]
fn a_note_survives_as_it_was_left_and_is_read_once() {
    let mut memory = [0xA5; note::LEN];
    for kind in [Kind::Panic, Kind::HardFault, Kind::Overdue, Kind::Asked] {
        note::write(&mut memory, kind, |text| {
            text.push("index out of bounds at src/x.rs:12");
        });
        let note = note::take(&mut memory).unwrap();
        assert_eq!((note.kind, note.text.as_str()), (kind, "index out of bounds at src/x.rs:12"));
        assert_eq!(note::take(&mut memory), None);
    }
    // Too long: cut, and not within a character.
    let long = ["y", &"ü".repeat(200)].concat();
    note::write(&mut memory, Kind::Panic, |text| {
        text.push(&long).push("x");
    });
    let note = note::take(&mut memory).unwrap();
    assert!(note.text.len() >= note::LEN - 12 && long.starts_with(note.text.as_str()), "{}", note.text);
}

#[test]
fn a_supply_that_fell_for_a_moment_is_told_from_one_that_came() {
    let mut memory = [0xA5; note::LEN];
    assert_eq!(note::supply_reset(note::has_survived(&memory)), ResetCause::PowerOn);
    assert_eq!(note::take(&mut memory), None);
    // It runs, and is reset without a note.
    assert_eq!(note::supply_reset(note::has_survived(&memory)), ResetCause::BrownOut);
    for bit in 0..note::LEN * 8 {
        let mut forgetting = memory;
        forgetting[bit / 8] ^= 1 << (bit % 8);
        assert!(!note::has_survived(&forgetting), "bit {bit}");
    }
    note::write(&mut memory, Kind::Panic, |_| ());
    assert!(note::has_survived(&memory), "a note has survived as well");
}

#[test]
fn every_single_wrong_bit_of_a_note_is_noticed() {
    let mut memory = [0; note::LEN];
    note::write(&mut memory, Kind::Overdue, |text| {
        text.push("estimate");
    });
    for bit in 0..note::LEN * 8 {
        let mut damaged = memory;
        damaged[bit / 8] ^= 1 << (bit % 8);
        assert_eq!(note::take(&mut damaged), None, "bit {bit}");
    }
}

proptest! {
    #[test]
    fn prop_memory_after_power_on_holds_no_note(bytes in prop::collection::vec(any::<u8>(), note::LEN)) {
        let mut memory = [0; note::LEN];
        memory.copy_from_slice(&bytes);
        prop_assert!(!note::has_survived(&memory));
        prop_assert_eq!(note::take(&mut memory), None);
    }
}
