//! Calibration update over CAN: what is taken, what is refused by name, and that nothing else gets through.
//!
//! | module | what it proves |
//! |---|---|
//! | [`taken`] | good updates are taken, and what is kept is read back |
//! | [`refused`] | each refusal has its name, is logged and changes nothing |
//! | [`counter`] | the counter against replay, also where a record of it cannot be read |
//! | [`bytes`] | commands, answers and the tag |
//! | [`service`] | store and session with one owner |

mod bytes;
mod counter;
mod refused;
mod service;
mod taken;

use embassy_futures::block_on;
use kou_app::calibration::CalibrationSource;
use kou_app::calibration::MachineIdentity;
use kou_app::calibration::load;
use kou_app::diagnostics::RejectReason;
use kou_app::diagnostics::{FaultCode, FaultMemory, FreezeFrame};
use kou_app::storage::{MIN_BYTES, Store, StoredCalibration};
use kou_app::update::wire::{UpdateAnswer, UpdateCommand};
use kou_app::update::{
    Key, KeySource, SessionAction, SessionOutcome, UpdateGuard, UpdateSession, UpdateTransfer,
};
use kou_emulation::RamFlash;
use kou_estimator::units::Micros;
use kou_estimator::{Calibration, Params};
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
struct TestController {
    session: UpdateSession,
    store: Store<RamFlash<{ MIN_BYTES as usize }, 2048>>,
    faults: FaultMemory,
    keys: Box<dyn KeySource>,
    default: Vec<u8>,
    counter: u32,
    crc: u32,
    machine: Option<MachineIdentity>,
    loaded: bool,
    now: Micros,
}

impl TestController {
    fn new(keys: impl KeySource + 'static) -> Self {
        let default = record_of(&with_serial(reference_calibration(), ""));
        let store = Store::new(RamFlash::new(), 0..MIN_BYTES).unwrap();
        let mut controller = Self {
            session: UpdateSession::new(),
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
        let loaded = block_on(load(&mut self.store, Some(&self.default), &mut None::<Params>));
        let live = loaded.live.unwrap();
        (self.counter, self.crc, self.machine) = (loaded.counter, live.state.crc, Some(live.machine));
        live.state.source
    }

    fn handle(&mut self, outcome: SessionOutcome) -> Option<UpdateAnswer> {
        if let Some(refusal) = outcome.rejected {
            self.faults.record_event(FaultCode::UpdateRefused(refusal), FreezeFrame::at(1));
        }
        let outcome = match outcome.todo {
            None => outcome,
            Some(SessionAction::Store { counter }) => {
                let stored = StoredCalibration { counter, record: self.session.record() };
                let written = block_on(self.store.write(&stored)).is_ok();
                let outcome = self.session.stored(written);
                self.start();
                outcome
            }
            Some(SessionAction::Fill(_)) => {
                let record = self.default.clone();
                self.session.fill(self.now, |buffer| {
                    buffer.get_mut(..record.len())?.copy_from_slice(&record);
                    Some(record.len())
                })
            }
        };
        outcome.answer.map(|(_, answer)| answer)
    }

    fn take(&mut self, tool: u8, command: [u8; 8]) -> Option<UpdateAnswer> {
        self.now.0 += 1000;
        let guard = UpdateGuard {
            loaded: self.loaded,
            keys: &*self.keys,
            counter: self.counter,
            machine: self.machine.as_ref(),
        };
        let outcome = self.session.receive(self.now, tool, command, &guard);
        self.handle(outcome)
    }

    /// Sends commands until one is not answered well; the last answer.
    fn send(&mut self, commands: impl IntoIterator<Item = UpdateCommand>) -> Option<UpdateAnswer> {
        let mut last = None;
        for command in commands {
            last = self.take(TOOL, command.to_bytes());
            if matches!(last, Some(UpdateAnswer::Rejected { .. }) | None) {
                break;
            }
        }
        last
    }

    /// What must not change when something is refused: what is live, what is stored, and the counter.
    fn unchanged(&mut self) -> (u32, u32, Option<MachineIdentity>) {
        self.start();
        (self.counter, self.crc, self.machine.clone())
    }

    #[track_caller]
    fn refuses(&mut self, commands: impl IntoIterator<Item = UpdateCommand>, why: RejectReason) {
        let before = self.unchanged();
        let occurred = |faults: &FaultMemory| {
            faults.get(FaultCode::UpdateRefused(why)).map_or(0, |entry| entry.occurrences)
        };
        let count = occurred(&self.faults);
        match self.send(commands) {
            Some(UpdateAnswer::Rejected { reason: found, .. }) => assert_eq!(found, why),
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

fn transfer(record: &[u8], counter: u32, key: &TestKey) -> UpdateTransfer {
    UpdateTransfer::new(record, counter, &key.0).unwrap()
}
