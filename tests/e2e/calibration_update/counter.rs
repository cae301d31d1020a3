//! The counter against replay, also where a record of it cannot be read.

use kou_app::storage::{Record, RecordKind, UpdateCounter};

use super::*;

/// The calibration's record as another version might lay it out.
#[derive(serde::Serialize, serde::Deserialize)]
struct Foreign(u8);

impl Record<'_> for Foreign {
    const KIND: RecordKind = RecordKind::Calibration;
    const SCHEMA: u16 = 99;
}

#[test]
fn a_stored_calibration_that_cannot_be_used_is_a_trouble_and_an_unknown_counter_takes_no_update() {
    let key = TestKey::new(1);
    // Of a calibration schema that this version does not read: the counter is kept, the default is used.
    let mut controller = TestController::new(TestKey::new(1));
    let mut old = record_of(&changed(0.001));
    old[4] = 1;
    block_on(controller.store.write(&StoredCalibration { counter: 8, record: &old })).unwrap();
    let loaded = block_on(load(&mut controller.store, Some(&controller.default), &mut None::<Params>));
    assert_eq!((loaded.counter, loaded.fault), (8, Some(FaultCode::CalibrationLost)));
    assert_eq!(controller.start(), CalibrationSource::Default);
    controller.refuses(transfer(&old, 9, &key).commands(), RejectReason::Record);
    // Of a layout that it does not read at all, with no record of the counter besides: any update could be an old one.
    block_on(controller.store.write(&Foreign(1))).unwrap();
    assert_eq!(controller.start(), CalibrationSource::Default);
    controller.refuses(transfer(&old, u32::MAX, &key).commands(), RejectReason::OldCounter);
    // The workshop's way back to the default: the counter stays.
    block_on(controller.store.erase()).unwrap();
    block_on(controller.store.write(&StoredCalibration { counter: 8, record: &[] })).unwrap();
    let loaded = block_on(load(&mut controller.store, Some(&controller.default), &mut None::<Params>));
    assert_eq!((loaded.counter, loaded.fault), (8, None));
    // Nothing at all: nothing to estimate with, and said so by its absence.
    assert!(block_on(load(&mut controller.store, None, &mut None::<Params>)).live.is_none());
}

#[test]
fn a_counter_that_the_calibration_no_longer_tells_is_known_from_its_own_record() {
    let key = TestKey::new(1);
    let mut controller = TestController::new(TestKey::new(1));
    block_on(controller.store.write(&UpdateCounter { counter: 8 })).unwrap();
    // A calibration of a layout that this version does not read.
    block_on(controller.store.write(&Foreign(1))).unwrap();
    assert_eq!(controller.start(), CalibrationSource::Default);
    assert_eq!(controller.counter, 8);
    let new = record_of(&changed(0.001));
    controller.refuses(transfer(&new, 8, &key).commands(), RejectReason::OldCounter);
    let answer = controller.send(transfer(&new, 9, &key).commands());
    assert!(matches!(answer, Some(UpdateAnswer::Committed { .. })), "{answer:?}");
    assert_eq!((controller.start(), controller.counter), (CalibrationSource::Stored, 9));
}

#[test]
fn the_larger_of_two_counters_holds_whichever_record_it_stands_in() {
    for (of_calibration, alone) in [(8, 5), (5, 8)] {
        let mut controller = TestController::new(TestKey::new(1));
        let record = record_of(&changed(0.001));
        block_on(async {
            let stored = StoredCalibration { counter: of_calibration, record: &record };
            controller.store.write(&stored).await.unwrap();
            controller.store.write(&UpdateCounter { counter: alone }).await.unwrap();
        });
        assert_eq!(controller.start(), CalibrationSource::Stored);
        assert_eq!(controller.counter, 8);
    }
}
