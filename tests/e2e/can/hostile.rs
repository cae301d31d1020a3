//! A million hostile frames.

use embassy_futures::block_on;
use kou_app::calibration::CalibrationState;
use kou_app::calibration::MachineIdentity;
use kou_app::diagnostics::RejectReason;
use kou_app::diagnostics::{FaultCode, FaultMemory, FreezeFrame};
use kou_app::j1939::catalogue as c;
use kou_app::j1939::{DriveReadings, Frame, GLOBAL, Id, Name, Node, Outputs, Pgn, Received};
use kou_app::storage::{MIN_BYTES, Store, StoredCalibration};
use kou_app::update::{SessionAction, UpdateGuard, UpdateSession, UpdateTransfer};
use kou_estimator::units::Micros;
use kou_estimator::{Estimate, Reason};
use kou_tests::samples::SplitMix64;
use kou_tests::{TestFlash, record_of, reference_calibration};

use super::{ADDRESS, DRIVE, TOOL, key, ms, name};

/// A node that has claimed its address by `now`.
fn claimed(now: u64, outputs: &Outputs<'_>) -> Node {
    let mut node = Node::new(name(), ADDRESS);
    for t in [now - 300, now - 1, now] {
        while node.poll(ms(t), outputs).is_some() {}
    }
    assert_eq!(node.address(), Some(ADDRESS));
    node
}

/// A frame that an attacker might send.
fn hostile(random: &mut SplitMix64, genuine: &[Frame], address: u8) -> Frame {
    let data = random.next_u64().to_le_bytes();
    let len = if random.one_in(3) { random.below(9) } else { 8 };
    let groups = [
        c::ETC1.pgn,
        c::HPG.pgn,
        c::TRF1.pgn,
        c::REQUEST.pgn,
        c::ADDRESS_CLAIMED.pgn,
        c::UPDATE_COMMAND.pgn,
        c::TP_CM.pgn,
        c::TP_DT.pgn,
        c::DM1.pgn,
        Pgn::new(65240),
    ];
    let source = [DRIVE, TOOL, address, random.next_u64() as u8][random.below(4)];
    let destination = [address, GLOBAL, random.next_u64() as u8][random.below(3)];
    match random.below(4) {
        0 => Frame::of(Id::from_raw(random.next_u64() as u32), &data[..len]).unwrap(),
        // Recorded frames of an update that was accepted once, some with a flipped bit.
        1 => {
            let frame = genuine[random.below(genuine.len())];
            let mut bytes: [u8; 8] = frame.data().try_into().unwrap();
            if random.one_in(2) {
                bytes[random.below(8)] ^= 1 << random.below(8);
            }
            Frame::of(Id::new(7, frame.id().pgn(), address, source), &bytes[..len]).unwrap()
        }
        // All update commands.
        2 => {
            let mut bytes = data;
            bytes[0] = [1, 2, 3, 4, 0x11, 0x12][random.below(6)];
            bytes[1] = if bytes[0] == 1 { 1 } else { random.below(4) as u8 };
            bytes[3] &= 3;
            Frame::of(Id::new(7, c::UPDATE_COMMAND.pgn, address, source), &bytes[..len]).unwrap()
        }
        _ => Frame::of(Id::new(6, groups[random.below(groups.len())], destination, source), &data[..len])
            .unwrap(),
    }
}

fn quiet<'a>(estimate: &'a Estimate, faults: &FaultMemory) -> Outputs<'a> {
    Outputs { estimate, health: None, calibration: CalibrationState::default(), dtcs: faults.reports() }
}

#[test]
fn prop_a_million_hostile_frames_change_neither_flash_nor_calibration_nor_address() {
    let key = key();
    let calibration = reference_calibration();
    let record = record_of(&calibration);
    let machine = MachineIdentity {
        name: calibration.machine.name.clone(),
        serial: calibration.machine.serial.clone(),
    };
    let counter = 9;
    // What the attacker recorded: the last accepted update, and one of it begun under a newer counter.
    let transfer = UpdateTransfer::new(&record, counter, key.key()).unwrap();
    let mut genuine: Vec<Frame> = transfer
        .commands()
        .map(|command| Frame::new(Id::new(7, c::UPDATE_COMMAND.pgn, ADDRESS, TOOL), command.to_bytes()))
        .collect();
    let mut newer = *genuine[0].data().first_chunk::<8>().unwrap();
    newer[4] = counter as u8 + 1;
    genuine[0] = Frame::new(genuine[0].id(), newer);

    let mut store = Store::new(TestFlash::new(), 0..MIN_BYTES).unwrap();
    block_on(store.write(&StoredCalibration { counter, record: &record })).unwrap();
    let cells = *store.flash().cells();

    let estimate = Estimate::invalid(Micros(0), Reason::NotLoaded);
    let mut faults = FaultMemory::new();
    let mut random = SplitMix64(1);
    let mut session = UpdateSession::new();
    let mut drive = DriveReadings::new(Some(DRIVE));
    let mut node = claimed(1000, &quiet(&estimate, &faults));
    let (mut replay, mut rejections, mut readings, mut lost, mut begun) = (0, 0_u32, 0_u32, 0_u32, 0_u32);
    for number in 0..1_000_000_u64 {
        let now = ms(1000 + number);
        // Now and then the attacker plays the recording from its beginning.
        let frame = if replay > 0 || random.one_in(2000) {
            let frame = genuine[replay];
            replay = (replay + 1) % genuine.len();
            frame
        } else {
            hostile(&mut random, &genuine, ADDRESS)
        };
        let before = drive.clone();
        let is_reading = drive.receive(now, &frame);
        let may_read = frame.id().source() == DRIVE
            && frame.data().len() == 8
            && [c::ETC1.pgn, c::HPG.pgn, c::TRF1.pgn].contains(&frame.id().pgn());
        assert_eq!(is_reading, may_read, "{frame:?}");
        assert!(may_read || drive == before, "{frame:?}");
        readings += u32::from(is_reading);
        let value = drive.high_pressure(now).value;
        assert!(value.is_err() || (0.0..=128.51).contains(&value.unwrap().get()));

        let received = node.receive(now, &frame);
        if let Received::Update { source, data } = received {
            let guard = UpdateGuard { loaded: false, keys: &key, counter, machine: Some(&machine) };
            let outcome = session.receive(now, source, data, &guard);
            match outcome.todo {
                Some(SessionAction::Store { .. }) => panic!("{frame:?} led to a write"),
                Some(SessionAction::Fill(_)) => {
                    assert!(session.fill(now, |_| None).rejected.is_some());
                }
                None => {}
            }
            begun += u32::from(outcome.answer.is_some() && outcome.rejected.is_none());
            rejections += u32::from(outcome.rejected.is_some());
            if let Some(why) = outcome.rejected {
                faults.record_event(FaultCode::UpdateRefused(why), FreezeFrame::at(0));
            }
        }
        session.poll(now);
        assert!(session.record().is_empty());
        // Whatever came, no more than a few frames go out for it, all under the controller's own address.
        for sent in 0.. {
            let Some(frame) = node.poll(now, &quiet(&estimate, &faults)) else { break };
            assert!(sent < 20, "a flood answered by a flood");
            let is_claim = frame.id().pgn() == c::ADDRESS_CLAIMED.pgn;
            assert!(is_claim || Some(frame.id().source()) == node.address());
        }
        if node.address() != Some(ADDRESS) {
            // Only a whole claim of this very address by a smaller name may do that.
            let is_claim = frame.id().pgn() == c::ADDRESS_CLAIMED.pgn && frame.id().source() == ADDRESS;
            assert!(is_claim && Name::from_bytes(frame.data().try_into().unwrap()) < name(), "{frame:?}");
            lost += 1;
            node = claimed(1000 + number, &quiet(&estimate, &faults));
        }
    }
    assert!(*store.flash().cells() == cells, "flash is untouched");
    // The last check was reached: a complete recording under a newer counter, rejected by its tag.
    assert!(faults.get(FaultCode::UpdateRefused(RejectReason::Mac)).is_some());
    println!(
        "{readings} readings, {rejections} rejections, {begun} commands accepted, address lost {lost} times"
    );
    // Every kind of frame was effective as an attack.
    assert!(readings > 1000 && rejections > 100_000 && begun > 1000 && lost > 100);
}
