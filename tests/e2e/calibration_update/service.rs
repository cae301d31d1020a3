//! Update service: owner of store and session.

use kou_app::storage::{HealthRecord, UpdateCounter};
use kou_app::update::{CommandOutcome, UpdateService};
use kou_emulation::ram_flash::Torn;
use kou_estimator::health::HealthState;
use kou_estimator::record;
use kou_tests::reference_params;

use super::*;

#[test]
fn the_service_adopts_an_update_and_reads_back_the_stored_records() {
    let key = TestKey::from_seed(1);
    let default = record_of(&with_serial(reference_calibration(), ""));
    let mut store = Store::new(TestFlash::new(), 0..MIN_BYTES).unwrap();
    let mut session = UpdateSession::new();
    let mut service = UpdateService::new(&mut store, &mut session, TestKey::from_seed(1), Some(&default));
    let mut place = None;
    let opened = block_on(service.open(&mut place));
    assert_eq!(
        (opened.adopted.map(|state| state.source), opened.fault),
        (Some(CalibrationSource::Default), None)
    );
    assert_eq!(place.as_ref(), Some(&reference_params()));
    let record = record_of(&changed(0.001));
    let send =
        |service: &mut UpdateService<'_, _, TestKey>, counter: u32, tool_key: &TestKey, loaded: bool| {
            let (mut last, mut place) = (CommandOutcome::default(), None);
            for (number, command) in transfer(&record, counter, tool_key).commands().enumerate() {
                let now = Micros(1000 * number as u64);
                last = block_on(service.receive(now, TOOL, command.to_bytes(), loaded, &mut place));
                if last.fault.is_some() {
                    break;
                }
            }
            (last, place)
        };
    let (rejected, place) = send(&mut service, 1, &TestKey::from_seed(2), false);
    assert_eq!(rejected.fault, Some(FaultCode::UpdateRefused(RejectReason::Mac)));
    assert!(rejected.adopted.is_none() && place.is_none());
    assert_eq!(
        send(&mut service, 1, &key, true).0.fault,
        Some(FaultCode::UpdateRefused(RejectReason::Loaded))
    );
    let (accepted, place) = send(&mut service, 1, &key, false);
    let crc = record::crc32(&record[..record.len() - 4]);
    assert_eq!(accepted.answer, Some((TOOL, UpdateAnswer::Committed { crc })));
    assert_eq!(accepted.adopted.map(|state| state.crc), Some(crc));
    assert_eq!(place, Some(Params::new(&changed(0.001)).unwrap()));
    let stored = block_on(service.store().read::<UpdateCounter>()).unwrap();
    assert_eq!(stored, Some(UpdateCounter { counter: 1 }));
    assert_eq!(
        send(&mut service, 1, &key, false).0.fault,
        Some(FaultCode::UpdateRefused(RejectReason::OldCounter))
    );
    // What is read is what is in use now; learned state only where there is one.
    let read = |service: &mut UpdateService<'_, _, TestKey>, what| {
        let command = UpdateCommand::Read { what }.to_bytes();
        block_on(service.receive(Micros(0), TOOL, command, false, &mut None::<Params>)).answer.unwrap().1
    };
    let length = u16::try_from(record.len()).unwrap();
    assert_eq!(
        read(&mut service, 1),
        UpdateAnswer::ReadReady { what: 1, length, crc: record::crc32(&record) }
    );
    assert!(matches!(
        read(&mut service, 2),
        UpdateAnswer::Rejected { reason: RejectReason::NothingStored, .. }
    ));
    let health = HealthRecord { calibration_crc: crc, state: HealthState::new() };
    block_on(service.write(&health)).unwrap();
    assert!(matches!(read(&mut service, 2), UpdateAnswer::ReadReady { what: 2, .. }));
    assert!(matches!(
        read(&mut service, 3),
        UpdateAnswer::Rejected { reason: RejectReason::NothingStored, .. }
    ));
    assert!(service.poll(Micros(2_000_000)).fault.is_none(), "a read-back may stop at any segment");
    // A flash that fails during the write: rejected, nothing adopted, further updates rejected until a restart.
    service.store().flash().cut_after(300, Torn::Clean);
    let (failed, place) = send(&mut service, 2, &key, false);
    assert_eq!(failed.fault, Some(FaultCode::UpdateRefused(RejectReason::Storage)));
    assert!(failed.adopted.is_none() && place.is_none());
    service.store().flash().power_on();
    assert_eq!(
        send(&mut service, 3, &key, false).0.fault,
        Some(FaultCode::UpdateRefused(RejectReason::OldCounter))
    );
}

#[test]
fn an_outdated_counter_record_is_corrected_at_the_next_start() {
    let mut store = Store::new(TestFlash::new(), 0..MIN_BYTES).unwrap();
    let record = record_of(&changed(0.001));
    block_on(store.write(&StoredCalibration { counter: 7, record: &record })).unwrap();
    block_on(store.write(&UpdateCounter { counter: 6 })).unwrap();
    let mut session = UpdateSession::new();
    let mut service = UpdateService::new(&mut store, &mut session, TestKey::from_seed(1), None);
    block_on(service.open(&mut None::<Params>));
    let stored = block_on(service.store().read::<UpdateCounter>()).unwrap();
    assert_eq!(stored, Some(UpdateCounter { counter: 7 }));
}
