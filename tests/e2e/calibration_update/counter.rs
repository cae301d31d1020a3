//! Replay counter, also where one of its records cannot be read.

use kou_app::storage::{Record, RecordKind, UpdateCounter};

use super::*;

/// The calibration's record in the layout of another version.
#[derive(serde::Serialize, serde::Deserialize)]
struct OtherLayout(u8);

impl Record<'_> for OtherLayout {
    const KIND: RecordKind = RecordKind::Calibration;
    const SCHEMA: u16 = 99;
}

#[test]
fn an_unusable_stored_calibration_is_a_diagnostic_fault_and_without_a_known_counter_updates_are_rejected() {
    let key = TestKey::from_seed(1);
    // Of a calibration schema that this version does not read: the counter is kept, the default is used.
    let mut controller = UpdateBench::new(TestKey::from_seed(1));
    let mut old = record_of(&changed(0.001));
    old[4] = 1;
    block_on(controller.store.write(&StoredCalibration { counter: 8, record: &old })).unwrap();
    let loaded = block_on(load(&mut controller.store, Some(&controller.default), &mut None::<Params>));
    assert_eq!((loaded.counter, loaded.fault), (8, Some(FaultCode::CalibrationLost)));
    assert_eq!(controller.start(), CalibrationSource::Default);
    controller.assert_rejected(transfer(&old, 9, &key).commands(), RejectReason::Record);
    // Of a layout that it does not read at all, and without a record of the counter: any update could be a replay.
    block_on(controller.store.write(&OtherLayout(1))).unwrap();
    assert_eq!(controller.start(), CalibrationSource::Default);
    controller.assert_rejected(transfer(&old, u32::MAX, &key).commands(), RejectReason::OldCounter);
    // The workshop's way back to the default: the counter stays.
    block_on(controller.store.erase()).unwrap();
    block_on(controller.store.write(&StoredCalibration { counter: 8, record: &[] })).unwrap();
    let loaded = block_on(load(&mut controller.store, Some(&controller.default), &mut None::<Params>));
    assert_eq!((loaded.counter, loaded.fault), (8, None));
    // Nothing at all: nothing to estimate with, and said so by its absence.
    assert!(block_on(load(&mut controller.store, None, &mut None::<Params>)).live.is_none());
}

#[test]
fn the_counter_is_read_from_its_own_record_where_the_calibration_record_cannot_be_read() {
    let key = TestKey::from_seed(1);
    let mut controller = UpdateBench::new(TestKey::from_seed(1));
    block_on(controller.store.write(&UpdateCounter { counter: 8 })).unwrap();
    // A calibration of a layout that this version does not read.
    block_on(controller.store.write(&OtherLayout(1))).unwrap();
    assert_eq!(controller.start(), CalibrationSource::Default);
    assert_eq!(controller.counter, 8);
    let new = record_of(&changed(0.001));
    controller.assert_rejected(transfer(&new, 8, &key).commands(), RejectReason::OldCounter);
    let answer = controller.send(transfer(&new, 9, &key).commands());
    assert!(matches!(answer, Some(UpdateAnswer::Committed { .. })), "{answer:?}");
    assert_eq!((controller.start(), controller.counter), (CalibrationSource::Stored, 9));
}

#[test]
fn the_larger_of_the_two_stored_counters_applies() {
    for (of_calibration, alone) in [(8, 5), (5, 8)] {
        let mut controller = UpdateBench::new(TestKey::from_seed(1));
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
