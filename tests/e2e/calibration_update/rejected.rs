//! Each reason of rejection: named, logged, without effect.

use kou_app::update::{NoKey, is_loaded, mac};
use kou_emulation::ram_flash::Torn;
use kou_estimator::record;
use kou_estimator::units::{Megapascal, RevPerMin};
use kou_estimator::{Fault, Reading, Sample};

use super::*;

#[test]
fn each_rejection_has_its_reason_is_logged_and_changes_nothing() {
    let key = TestKey::from_seed(1);
    let mut controller = UpdateBench::new(TestKey::from_seed(1));
    let first = record_of(&changed(0.001));
    assert!(matches!(
        controller.send(transfer(&first, 5, &key).commands()),
        Some(UpdateAnswer::Committed { .. })
    ));
    let new = record_of(&changed(0.002));
    let good = transfer(&new, 6, &key);
    let commands: Vec<UpdateCommand> = good.commands().collect();

    // Authentication: a wrong key, a changed byte, a tag for another counter.
    controller.assert_rejected(transfer(&new, 6, &TestKey::from_seed(2)).commands(), RejectReason::Mac);
    let mut tampered = new.clone();
    tampered[100] ^= 1;
    let tag = mac::tag(key.key(), 6, &new).unwrap();
    controller
        .assert_rejected(UpdateTransfer::with_tag(&tampered, 6, &tag).unwrap().commands(), RejectReason::Mac);
    controller
        .assert_rejected(UpdateTransfer::with_tag(&new, 7, &tag).unwrap().commands(), RejectReason::Mac);
    // Replay.
    controller.assert_rejected(transfer(&first, 5, &key).commands(), RejectReason::OldCounter);
    controller.assert_rejected(transfer(&new, 4, &key).commands(), RejectReason::OldCounter);
    // Another machine, of another serial number or another type.
    let other = record_of(&with_serial(changed(0.002), "e2e-2"));
    controller.assert_rejected(transfer(&other, 6, &key).commands(), RejectReason::WrongMachine);
    let mut other = changed(0.002);
    other.machine.name = heapless::String::try_from("another type").unwrap();
    controller.assert_rejected(transfer(&record_of(&other), 6, &key).commands(), RejectReason::WrongMachine);
    // No record; a record with a field that the checks refuse.
    controller.assert_rejected(transfer(&[0x55; 300], 6, &key).commands(), RejectReason::Record);
    let wrong = record_of(&changed(1e6));
    controller.assert_rejected(transfer(&wrong, 6, &key).commands(), RejectReason::Field);
    // Lengths that no record has.
    for length in [0, 11, record::calibration::MAX_LEN as u16 + 1, u16::MAX] {
        controller.assert_rejected([UpdateCommand::Begin { length, counter: 6 }], RejectReason::Length);
    }
    // Segments that are missing, twice, or too many; commit too early; no beginning.
    let mut skipped = commands.clone();
    skipped.remove(10);
    controller.assert_rejected(skipped, RejectReason::OutOfOrder);
    let mut twice = commands.clone();
    twice.insert(10, twice[10]);
    controller.assert_rejected(twice, RejectReason::OutOfOrder);
    let mut many = commands.clone();
    let next = u8::try_from(commands.len() - 2).unwrap();
    many.insert(commands.len() - 1, UpdateCommand::Data { number: next, bytes: [0; 6] });
    controller.assert_rejected(many, RejectReason::OutOfOrder);
    let early = commands[..50].iter().copied().chain([UpdateCommand::Commit]);
    controller.assert_rejected(early.collect::<Vec<_>>(), RejectReason::Incomplete);
    controller.assert_rejected(commands[1..].to_vec(), RejectReason::NoTransfer);
    controller.assert_rejected([UpdateCommand::Commit], RejectReason::NoTransfer);
    // A loaded drive: at the beginning, and when it came under load meanwhile.
    controller.loaded = true;
    controller.assert_rejected(commands.clone(), RejectReason::Loaded);
    controller.loaded = false;
    let _ = controller.send(commands[..commands.len() - 1].to_vec());
    controller.loaded = true;
    controller.assert_rejected([UpdateCommand::Commit], RejectReason::Loaded);
    controller.loaded = false;
    // A tool that falls silent; a second tool that interferes.
    let _ = controller.send(commands[..20].to_vec());
    let interrupted = controller.receive(0xFA, commands[0].to_bytes());
    assert!(matches!(interrupted, Some(UpdateAnswer::Rejected { reason: RejectReason::Busy, .. })));
    controller.now.0 += 1_000_001;
    let outcome = controller.session.poll(controller.now);
    assert_eq!(outcome.rejected, Some(RejectReason::TimeOut));
    assert!(controller.handle(outcome).is_some() && controller.session.is_idle());
    // A command of no version.
    let unknown = controller.receive(TOOL, [0x77; 8]);
    assert!(matches!(unknown, Some(UpdateAnswer::Rejected { reason: RejectReason::Unknown, .. })));
    for why in [RejectReason::TimeOut, RejectReason::Busy, RejectReason::Unknown] {
        assert!(controller.faults.get(FaultCode::UpdateRefused(why)).is_some(), "{why:?} is logged");
    }
    // A flash that fails.
    controller.store.flash().cut_after(300, Torn::Clean);
    let answer = commands.iter().fold(None, |_, command| {
        controller.now.0 += 1000;
        let guard = UpdateGuard {
            loaded: false,
            keys: &*controller.keys,
            counter: controller.counter,
            machine: controller.machine.as_ref(),
        };
        let outcome = controller.session.receive(controller.now, TOOL, command.to_bytes(), &guard);
        match outcome.todo {
            Some(SessionAction::Store { counter }) => {
                let stored = StoredCalibration { counter, record: controller.session.record() };
                let written = block_on(controller.store.write(&stored)).is_ok();
                controller.session.stored(written).rejected
            }
            _ => outcome.rejected,
        }
    });
    assert_eq!(answer, Some(RejectReason::Storage));
    controller.store.flash().power_on();
    assert_eq!(controller.snapshot().0, 5);

    // After all of these, a good update is still accepted.
    assert!(matches!(controller.send(commands), Some(UpdateAnswer::Committed { .. })));
    assert_eq!(controller.counter, 6);
}

#[test]
fn a_controller_without_a_key_rejects_updates() {
    let mut controller = UpdateBench::new(NoKey);
    let new = record_of(&changed(0.001));
    controller.assert_rejected(transfer(&new, 1, &TestKey::from_seed(1)).commands(), RejectReason::NoKey);
}

#[test]
fn an_unknown_load_counts_as_loaded() {
    let threshold = Megapascal(3.0);
    let at = |high: Result<f32, Fault>, speed: Result<f32, Fault>| {
        let mut sample = Sample::empty(Micros(0));
        sample.high_pressure = Reading { time: Micros(0), value: high.map(Megapascal) };
        sample.low_pressure = Reading::new(Micros(0), Megapascal(1.5));
        sample.pump_speed = Reading { time: Micros(0), value: speed.map(RevPerMin) };
        is_loaded(&sample, threshold)
    };
    let failed = Err(Fault::OutOfRange);
    assert!(!at(Ok(4.4), Ok(1500.0)) && at(Ok(4.6), Ok(0.0)));
    assert!(at(Ok(f32::NAN), Ok(0.0)));
    assert!(!at(failed, Ok(0.0)) && at(failed, Ok(100.0)) && at(failed, Err(Fault::Stale)));
}
