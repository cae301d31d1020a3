//! Calibration update over CAN: what is taken, what is refused by name, and that nothing else gets through.

use embassy_futures::block_on;
use host_sim::update::{Addresses, candump, frames};
use kou_app::faults::{Code, FaultMemory, Snapshot};
use kou_app::j1939::CalibrationSource;
use kou_app::j1939::node::UPDATE;
use kou_app::storage::ram::Torn;
use kou_app::storage::{HealthRecord, Kind, MIN_BYTES, RamFlash, Record, Store, StoredCalibration, load};
use kou_app::update::wire::{Answer, Command};
use kou_app::update::{
    Guard, Handled, Key, KeySource, Machine, NoKey, Outcome, Refusal, Service, Session, Todo, Transfer,
    is_loaded, mac,
};
use kou_estimator::calibration::record;
use kou_estimator::health::HealthState;
use kou_estimator::units::{Megapascal, Micros, RevPerMin};
use kou_estimator::{Calibration, Fault, Reading, Sample};
use kou_tests::samples::Random;
use kou_tests::{record_of, reference_calibration};

const TOOL: u8 = 0xF9;

/// A key made for the test that uses it.
struct TestKey(Key);

impl TestKey {
    fn new(seed: u64) -> Self {
        let mut random = Random(seed);
        Self(Key::new(std::array::from_fn(|_| random.bits() as u8)))
    }
}

impl KeySource for TestKey {
    fn update_key(&self) -> Option<Key> {
        Some(self.0.clone())
    }
}

/// Serial numbers are texts of their own type.
fn with_serial(mut calibration: Calibration, serial: &str) -> Calibration {
    calibration.machine.serial = heapless::String::try_from(serial).unwrap();
    calibration
}

/// A controller with flash, live calibration and session, as the firmware's tasks put them together.
struct Controller {
    session: Session,
    store: Store<RamFlash<{ MIN_BYTES as usize }, 2048>>,
    faults: FaultMemory,
    keys: Box<dyn KeySource>,
    default: Vec<u8>,
    counter: u32,
    crc: u32,
    machine: Option<Machine>,
    loaded: bool,
    now: Micros,
}

impl Controller {
    fn new(keys: impl KeySource + 'static) -> Self {
        let default = record_of(&with_serial(reference_calibration(), ""));
        let store = Store::new(RamFlash::new(), 0..MIN_BYTES).unwrap();
        let mut controller = Self {
            session: Session::new(),
            store,
            faults: FaultMemory::new(),
            keys: Box::new(keys),
            default,
            counter: 0,
            crc: 0,
            machine: None,
            loaded: false,
            now: Micros(1_000_000),
        };
        controller.start();
        controller
    }

    /// What a restart finds.
    fn start(&mut self) -> CalibrationSource {
        let loaded = block_on(load(&mut self.store, Some(&self.default)));
        let live = loaded.live.unwrap();
        (self.counter, self.crc, self.machine) = (loaded.counter, live.state.crc, Some(live.machine));
        live.state.source
    }

    fn handle(&mut self, outcome: Outcome) -> Option<Answer> {
        if let Some(refusal) = outcome.refused {
            self.faults.happened(Code::UpdateRefused(refusal), Snapshot::at(1));
        }
        let outcome = match outcome.todo {
            None => outcome,
            Some(Todo::Store { counter }) => {
                let stored = StoredCalibration { counter, record: self.session.record() };
                let written = block_on(self.store.write(&stored)).is_ok();
                let outcome = self.session.stored(written);
                self.start();
                outcome
            }
            Some(Todo::Fill(_)) => {
                let record = self.default.clone();
                self.session.fill(self.now, |buffer| {
                    buffer.get_mut(..record.len())?.copy_from_slice(&record);
                    Some(record.len())
                })
            }
        };
        outcome.answer.map(|(_, answer)| answer)
    }

    fn take(&mut self, tool: u8, command: [u8; 8]) -> Option<Answer> {
        self.now.0 += 1000;
        let guard = Guard {
            loaded: self.loaded,
            keys: &*self.keys,
            counter: self.counter,
            machine: self.machine.as_ref(),
        };
        let outcome = self.session.receive(self.now, tool, command, &guard);
        self.handle(outcome)
    }

    /// Sends commands until one is not answered well; the last answer.
    fn send(&mut self, commands: impl IntoIterator<Item = Command>) -> Option<Answer> {
        let mut last = None;
        for command in commands {
            last = self.take(TOOL, command.to_bytes());
            if matches!(last, Some(Answer::Refused { .. }) | None) {
                break;
            }
        }
        last
    }

    /// What must not change when something is refused: what is live, what is stored, and the counter.
    fn unchanged(&mut self) -> (u32, u32, Option<Machine>) {
        self.start();
        (self.counter, self.crc, self.machine.clone())
    }

    #[track_caller]
    fn refuses(&mut self, commands: impl IntoIterator<Item = Command>, why: Refusal) {
        let before = self.unchanged();
        let occurred =
            |faults: &FaultMemory| faults.get(Code::UpdateRefused(why)).map_or(0, |entry| entry.occurrences);
        let count = occurred(&self.faults);
        match self.send(commands) {
            Some(Answer::Refused { why: found, .. }) => assert_eq!(found, why),
            other => panic!("{other:?} instead of {why:?}"),
        }
        assert_eq!(occurred(&self.faults), count + 1, "{why:?} is logged");
        assert_eq!(self.unchanged(), before, "{why:?} changes nothing");
    }
}

fn changed(by: f32) -> Calibration {
    let mut calibration = reference_calibration();
    calibration.law.c += by;
    calibration
}

fn transfer(record: &[u8], counter: u32, key: &TestKey) -> Transfer {
    Transfer::new(record, counter, &key.0).unwrap()
}

#[test]
fn an_update_is_checked_stored_and_live_and_survives_a_restart() {
    let key = TestKey::new(1);
    let mut controller = Controller::new(TestKey::new(1));
    assert_eq!(controller.start(), CalibrationSource::Default);
    let new = record_of(&changed(0.001));
    let crc = record::crc32(&new[..new.len() - 4]);
    let answer = controller.send(transfer(&new, 5, &key).commands());
    assert_eq!(answer, Some(Answer::Committed { crc }));
    assert_eq!(controller.start(), CalibrationSource::Stored);
    assert_eq!((controller.counter, controller.crc), (5, crc));
    // From now on the controller belongs to the machine of this serial number.
    assert_eq!(controller.machine.as_ref().unwrap().serial, "e2e-1");
    assert!(controller.faults.entries().is_empty());
}

#[test]
fn frames_of_the_pc_tool_are_taken() {
    let mut random = Random(1);
    let key = Key::new(std::array::from_fn(|_| random.bits() as u8));
    let mut controller = Controller::new(TestKey::new(1));
    let addresses = Addresses { controller: 0x27, tool: TOOL };
    let frames = frames(&changed(0.001), 3, &key, addresses).unwrap();
    let mut last = None;
    for frame in &frames {
        assert_eq!((frame.id().pgn(), frame.id().destination(), frame.id().source()), (UPDATE, 0x27, TOOL));
        last = controller.take(TOOL, frame.data().try_into().unwrap());
    }
    assert!(matches!(last, Some(Answer::Committed { .. })), "{last:?}");
    assert_eq!(controller.counter, 3);
    let log = candump(&frames, 20);
    assert!(log.starts_with("(0.000000) can0 1CEF27F9#0101"), "{log}");
    assert_eq!(log.lines().count(), frames.len());
}

#[test]
fn each_refusal_has_its_name_is_logged_and_changes_nothing() {
    let key = TestKey::new(1);
    let mut controller = Controller::new(TestKey::new(1));
    let first = record_of(&changed(0.001));
    assert!(matches!(controller.send(transfer(&first, 5, &key).commands()), Some(Answer::Committed { .. })));
    let new = record_of(&changed(0.002));
    let good = transfer(&new, 6, &key);
    let commands: Vec<Command> = good.commands().collect();

    // Authentication: a wrong key, a changed byte, a tag for another counter.
    controller.refuses(transfer(&new, 6, &TestKey::new(2)).commands(), Refusal::Mac);
    let mut tampered = new.clone();
    tampered[100] ^= 1;
    let tag = mac::tag(&key.0, 6, &new).unwrap();
    controller.refuses(Transfer::with_tag(&tampered, 6, &tag).unwrap().commands(), Refusal::Mac);
    controller.refuses(Transfer::with_tag(&new, 7, &tag).unwrap().commands(), Refusal::Mac);
    // Replay.
    controller.refuses(transfer(&first, 5, &key).commands(), Refusal::OldCounter);
    controller.refuses(transfer(&new, 4, &key).commands(), Refusal::OldCounter);
    // Another machine, of another serial number or another type.
    let other = record_of(&with_serial(changed(0.002), "e2e-2"));
    controller.refuses(transfer(&other, 6, &key).commands(), Refusal::WrongMachine);
    let mut other = changed(0.002);
    other.machine.name = heapless::String::try_from("another type").unwrap();
    controller.refuses(transfer(&record_of(&other), 6, &key).commands(), Refusal::WrongMachine);
    // No record; a record with a field that the checks refuse.
    controller.refuses(transfer(&[0x55; 300], 6, &key).commands(), Refusal::Record);
    let wrong = record_of(&changed(1e6));
    controller.refuses(transfer(&wrong, 6, &key).commands(), Refusal::Field);
    // Lengths that no record has.
    for length in [0, 11, record::MAX_LEN as u16 + 1, u16::MAX] {
        controller.refuses([Command::Begin { length, counter: 6 }], Refusal::Length);
    }
    // Segments that are missing, twice, or too many; commit too early; no beginning.
    let mut skipped = commands.clone();
    skipped.remove(10);
    controller.refuses(skipped, Refusal::OutOfOrder);
    let mut twice = commands.clone();
    twice.insert(10, twice[10]);
    controller.refuses(twice, Refusal::OutOfOrder);
    let mut many = commands.clone();
    let next = u8::try_from(commands.len() - 2).unwrap();
    many.insert(commands.len() - 1, Command::Data { number: next, bytes: [0; 6] });
    controller.refuses(many, Refusal::OutOfOrder);
    let early = commands[..50].iter().copied().chain([Command::Commit]);
    controller.refuses(early.collect::<Vec<_>>(), Refusal::Incomplete);
    controller.refuses(commands[1..].to_vec(), Refusal::NoTransfer);
    controller.refuses([Command::Commit], Refusal::NoTransfer);
    // A loaded drive: at the beginning, and when it came under load meanwhile.
    controller.loaded = true;
    controller.refuses(commands.clone(), Refusal::Loaded);
    controller.loaded = false;
    let _ = controller.send(commands[..commands.len() - 1].to_vec());
    controller.loaded = true;
    controller.refuses([Command::Commit], Refusal::Loaded);
    controller.loaded = false;
    // A tool that falls silent; a second tool that barges in.
    let _ = controller.send(commands[..20].to_vec());
    let interrupted = controller.take(0xFA, commands[0].to_bytes());
    assert!(matches!(interrupted, Some(Answer::Refused { why: Refusal::Busy, .. })));
    controller.now.0 += 1_000_001;
    let outcome = controller.session.poll(controller.now);
    assert_eq!(outcome.refused, Some(Refusal::TimeOut));
    assert!(controller.handle(outcome).is_some() && controller.session.is_idle());
    // A command of no version.
    let unknown = controller.take(TOOL, [0x77; 8]);
    assert!(matches!(unknown, Some(Answer::Refused { why: Refusal::Unknown, .. })));
    for why in [Refusal::TimeOut, Refusal::Busy, Refusal::Unknown] {
        assert!(controller.faults.get(Code::UpdateRefused(why)).is_some(), "{why:?} is logged");
    }
    // A flash that fails.
    controller.store.flash().cut_after(300, kou_app::storage::ram::Torn::Clean);
    let answer = commands.iter().fold(None, |_, command| {
        controller.now.0 += 1000;
        let guard = Guard {
            loaded: false,
            keys: &*controller.keys,
            counter: controller.counter,
            machine: controller.machine.as_ref(),
        };
        let outcome = controller.session.receive(controller.now, TOOL, command.to_bytes(), &guard);
        match outcome.todo {
            Some(Todo::Store { counter }) => {
                let stored = StoredCalibration { counter, record: controller.session.record() };
                let written = block_on(controller.store.write(&stored)).is_ok();
                controller.session.stored(written).refused
            }
            _ => outcome.refused,
        }
    });
    assert_eq!(answer, Some(Refusal::Storage));
    controller.store.flash().power_on();
    assert_eq!(controller.unchanged().0, 5);

    // After all of it, the good one is still taken.
    assert!(matches!(controller.send(commands), Some(Answer::Committed { .. })));
    assert_eq!(controller.counter, 6);
}

/// The calibration's record as another version might lay it out.
#[derive(serde::Serialize, serde::Deserialize)]
struct Foreign(u8);

impl Record<'_> for Foreign {
    const KIND: Kind = Kind::Calibration;
    const SCHEMA: u16 = 99;
}

#[test]
fn a_stored_calibration_that_cannot_be_used_is_a_trouble_and_an_unreadable_counter_takes_no_update() {
    let key = TestKey::new(1);
    // Of a calibration schema that this version does not read: the counter is kept, the default is used.
    let mut controller = Controller::new(TestKey::new(1));
    let mut old = record_of(&changed(0.001));
    old[4] = 1;
    block_on(controller.store.write(&StoredCalibration { counter: 8, record: &old })).unwrap();
    let loaded = block_on(load(&mut controller.store, Some(&controller.default)));
    assert_eq!((loaded.counter, loaded.trouble), (8, Some(Code::CalibrationLost)));
    assert_eq!(controller.start(), CalibrationSource::Default);
    controller.refuses(transfer(&old, 9, &key).commands(), Refusal::Record);
    // Of a layout that it does not read at all: any update could be an old one.
    block_on(controller.store.write(&Foreign(1))).unwrap();
    assert_eq!(controller.start(), CalibrationSource::Default);
    controller.refuses(transfer(&old, u32::MAX, &key).commands(), Refusal::OldCounter);
    // The workshop's way back to the default: the counter stays.
    block_on(controller.store.erase()).unwrap();
    block_on(controller.store.write(&StoredCalibration { counter: 8, record: &[] })).unwrap();
    let loaded = block_on(load(&mut controller.store, Some(&controller.default)));
    assert_eq!((loaded.counter, loaded.trouble), (8, None));
    // Nothing at all: nothing to estimate with, and said so by its absence.
    assert!(block_on(load(&mut controller.store, None)).live.is_none());
}

#[test]
fn a_controller_without_a_key_takes_no_update() {
    let mut controller = Controller::new(NoKey);
    let new = record_of(&changed(0.001));
    controller.refuses(transfer(&new, 1, &TestKey::new(1)).commands(), Refusal::NoKey);
}

#[test]
fn what_is_stored_is_read_back_in_segments() {
    let mut controller = Controller::new(NoKey);
    let Some(Answer::ToBeRead { what: 1, length, crc }) = controller.send([Command::Read { what: 1 }]) else {
        panic!("nothing to be read")
    };
    let mut bytes = Vec::new();
    for number in 0..usize::from(length).div_ceil(6) {
        let number = u8::try_from(number).unwrap();
        match controller.send([Command::Next { number }]) {
            Some(Answer::Segment { number: found, bytes: six }) if found == number => bytes.extend(six),
            other => panic!("{other:?}"),
        }
    }
    bytes.truncate(usize::from(length));
    assert_eq!(bytes, controller.default);
    assert_eq!(record::crc32(&bytes), crc);
    assert!(matches!(controller.send([Command::Next { number: 255 }]), Some(Answer::Refused { .. })));
}

#[test]
fn every_command_and_answer_is_read_as_it_was_written() {
    let mut random = Random(7);
    for _ in 0..100_000 {
        let bytes: [u8; 8] = random.bits().to_le_bytes();
        if let Some(command) = Command::from_bytes(bytes) {
            assert_eq!(Command::from_bytes(command.to_bytes()), Some(command));
        }
        let mut bytes = bytes;
        bytes[0] = [0x81, 0x82, 0x83, 0x84, 0x91, 0x92, 0x7F, bytes[0]][random.below(8)];
        if let Some(answer) = Answer::from_bytes(bytes) {
            assert_eq!(Answer::from_bytes(answer.to_bytes()), Some(answer));
        }
    }
    for refusal in Refusal::ALL {
        assert_eq!(Refusal::from_number(refusal.number()), Some(refusal));
    }
}

#[test]
fn what_is_not_known_counts_as_loaded() {
    let least = Megapascal(3.0);
    let at = |high: Result<f32, Fault>, speed: Result<f32, Fault>| {
        let mut sample = Sample::empty(Micros(0));
        sample.high_pressure = Reading { time: Micros(0), value: high.map(Megapascal) };
        sample.low_pressure = Reading::new(Micros(0), Megapascal(1.5));
        sample.pump_speed = Reading { time: Micros(0), value: speed.map(RevPerMin) };
        is_loaded(&sample, least)
    };
    let failed = Err(Fault::OutOfRange);
    assert!(!at(Ok(4.4), Ok(1500.0)) && at(Ok(4.6), Ok(0.0)));
    assert!(at(Ok(f32::NAN), Ok(0.0)));
    assert!(!at(failed, Ok(0.0)) && at(failed, Ok(100.0)) && at(failed, Err(Fault::Stale)));
}

#[test]
fn val_the_tag_agrees_with_an_independent_hmac_and_depends_on_all_that_it_covers() {
    let key = Key::new(std::array::from_fn(|i| i as u8));
    let record = [1, 2, 3];
    let tag = mac::tag(&key, 0x0403_0201, &record).unwrap();
    // Python 3.11: hmac.new(bytes(range(32)), b"KOU-CAL-1" + struct.pack("<IH", 0x04030201, 3) + b"\1\2\3", "sha256")
    let hex: String = tag.iter().map(|byte| format!("{byte:02x}")).collect();
    assert_eq!(hex, "1c435ad7a64c93132c55850754ad5aeffc7eb7b905f21ba8b42e54e4a272edf3");
    for (counter, changed) in [(0x0403_0202, vec![1, 2, 3]), (0x0403_0201, vec![1, 2, 4])] {
        assert_ne!(mac::tag(&key, counter, &changed), Some(tag));
        assert!(!mac::is_authentic(&key, counter, &changed, &tag));
    }
    assert!(mac::is_authentic(&key, 0x0403_0201, &record, &tag));
    assert!(!mac::is_authentic(&key, 0x0403_0201, &record, &tag[..31]));
    assert!(!mac::is_authentic(&TestKey::new(4).0, 0x0403_0201, &record, &tag));
}

#[test]
fn the_service_adopts_an_update_and_gives_out_what_it_keeps() {
    let key = TestKey::new(1);
    let default = record_of(&with_serial(reference_calibration(), ""));
    let store = Store::new(RamFlash::<{ MIN_BYTES as usize }, 2048>::new(), 0..MIN_BYTES).unwrap();
    let (mut service, loaded) = block_on(Service::start(store, TestKey::new(1), Some(&default)));
    assert_eq!(loaded.live.unwrap().state.source, CalibrationSource::Default);
    let record = record_of(&changed(0.001));
    let send = |service: &mut Service<'_, _, TestKey>, counter: u32, tool_key: &TestKey, loaded: bool| {
        let mut last = Handled::default();
        for (number, command) in transfer(&record, counter, tool_key).commands().enumerate() {
            let now = Micros(1000 * number as u64);
            last = block_on(service.receive(now, TOOL, command.to_bytes(), loaded, None));
            if last.trouble.is_some() {
                break;
            }
        }
        last
    };
    let refused = send(&mut service, 1, &TestKey::new(2), false);
    assert_eq!(refused.trouble, Some(Code::UpdateRefused(Refusal::Mac)));
    assert!(refused.live.is_none());
    assert_eq!(send(&mut service, 1, &key, true).trouble, Some(Code::UpdateRefused(Refusal::Loaded)));
    let taken = send(&mut service, 1, &key, false);
    let crc = record::crc32(&record[..record.len() - 4]);
    assert_eq!(taken.answer, Some((TOOL, Answer::Committed { crc })));
    assert_eq!(taken.live.unwrap().state.crc, crc);
    assert_eq!(send(&mut service, 1, &key, false).trouble, Some(Code::UpdateRefused(Refusal::OldCounter)));
    // What is read is what is in use now; learned state only where there is one.
    let read = |service: &mut Service<'_, _, TestKey>, what, health: Option<&HealthRecord>| {
        let command = Command::Read { what }.to_bytes();
        block_on(service.receive(Micros(0), TOOL, command, false, health)).answer.unwrap().1
    };
    let length = u16::try_from(record.len()).unwrap();
    assert_eq!(
        read(&mut service, 1, None),
        Answer::ToBeRead { what: 1, length, crc: record::crc32(&record) }
    );
    assert!(matches!(read(&mut service, 2, None), Answer::Refused { why: Refusal::NothingStored, .. }));
    let health = HealthRecord { calibration_crc: crc, state: HealthState::new() };
    assert!(matches!(read(&mut service, 2, Some(&health)), Answer::ToBeRead { what: 2, .. }));
    assert!(service.poll(Micros(2_000_000)).trouble.is_none(), "a tool that stops reading has read enough");
    // A flash that fails in the middle: refused, nothing given out, nothing more taken until a restart.
    service.store().flash().cut_after(300, Torn::Clean);
    let failed = send(&mut service, 2, &key, false);
    assert_eq!(failed.trouble, Some(Code::UpdateRefused(Refusal::Storage)));
    assert!(failed.live.is_none());
    service.store().flash().power_on();
    assert_eq!(send(&mut service, 3, &key, false).trouble, Some(Code::UpdateRefused(Refusal::OldCounter)));
}
