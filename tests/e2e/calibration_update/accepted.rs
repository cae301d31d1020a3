//! Accepted updates, and read-back of the stored record.

use host_sim::update::{Addresses, candump, frames};
use kou_app::j1939::node::UPDATE;
use kou_app::update::NoKey;
use kou_estimator::record;

use super::*;

#[test]
fn an_update_is_checked_stored_and_live_and_survives_a_restart() {
    let key = TestKey::from_seed(1);
    let mut controller = UpdateBench::new(TestKey::from_seed(1));
    assert_eq!(controller.start(), CalibrationSource::Default);
    let new = record_of(&changed(0.001));
    let crc = record::crc32(&new[..new.len() - 4]);
    let answer = controller.send(transfer(&new, 5, &key).commands());
    assert_eq!(answer, Some(UpdateAnswer::Committed { crc }));
    assert_eq!(controller.start(), CalibrationSource::Stored);
    assert_eq!((controller.counter, controller.crc), (5, crc));
    // From now on the controller accepts updates for this serial number only.
    assert_eq!(controller.machine.as_ref().unwrap().serial, "e2e-1");
    assert!(controller.faults.entries().is_empty());
}

#[test]
fn frames_of_the_pc_tool_are_accepted() {
    let key = TestKey::from_seed(1);
    let mut controller = UpdateBench::new(TestKey::from_seed(1));
    let addresses = Addresses { controller: 0x27, tool: TOOL };
    let frames = frames(&changed(0.001), 3, key.key(), addresses).unwrap();
    let mut last = None;
    for frame in &frames {
        assert_eq!((frame.id().pgn(), frame.id().destination(), frame.id().source()), (UPDATE, 0x27, TOOL));
        last = controller.receive(TOOL, frame.data().try_into().unwrap());
    }
    assert!(matches!(last, Some(UpdateAnswer::Committed { .. })), "{last:?}");
    assert_eq!(controller.counter, 3);
    let log = candump(&frames, 20);
    assert!(log.starts_with("(0.000000) can0 1CEF27F9#0101"), "{log}");
    assert_eq!(log.lines().count(), frames.len());
}

#[test]
fn the_stored_record_is_read_back_in_segments() {
    let mut controller = UpdateBench::new(NoKey);
    let Some(UpdateAnswer::ReadReady { what: 1, length, crc }) =
        controller.send([UpdateCommand::Read { what: 1 }])
    else {
        panic!("nothing to be read")
    };
    let mut bytes = Vec::new();
    for number in 0..usize::from(length).div_ceil(6) {
        let number = u8::try_from(number).unwrap();
        match controller.send([UpdateCommand::Next { number }]) {
            Some(UpdateAnswer::Segment { number: found, bytes: six }) if found == number => bytes.extend(six),
            other => panic!("{other:?}"),
        }
    }
    bytes.truncate(usize::from(length));
    assert_eq!(bytes, controller.default);
    assert_eq!(record::crc32(&bytes), crc);
    assert!(matches!(
        controller.send([UpdateCommand::Next { number: 255 }]),
        Some(UpdateAnswer::Rejected { .. })
    ));
}
