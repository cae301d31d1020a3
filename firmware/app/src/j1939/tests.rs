//! The J1939 node against frames of other nodes.

use kou_estimator::units::{LeakageCoefficient, Micros};
use kou_estimator::{Channel, Estimate, Fault};
use std::vec::Vec;

use super::catalogue as c;
use super::example::example_estimate as estimate;
use super::signal::Absent;
use super::*;
use crate::calibration::CalibrationState;
use crate::diagnostics::{FaultCode, FaultMemory, FreezeFrame};

const ADDRESS: u8 = 0x27;

fn ms(ms: u64) -> Micros {
    Micros(1000 * ms)
}

fn name() -> Name {
    Name::new(&NameConfig::transmission(1000)).unwrap()
}

fn outputs<'a>(estimate: &'a Estimate, faults: &FaultMemory) -> Outputs<'a> {
    Outputs { estimate, health: None, calibration: CalibrationState::default(), dtcs: faults.reports() }
}

/// Frames sent until `until`, polled every 10 ms.
fn sent(node: &mut Node, from: u64, until: u64, outputs: &Outputs<'_>) -> Vec<(u64, Frame)> {
    let mut frames = Vec::new();
    for now in (from..until).step_by(10) {
        while let Some(frame) = node.poll(ms(now), outputs) {
            frames.push((now, frame));
        }
    }
    frames
}

fn claimed(outputs: &Outputs<'_>) -> Node {
    let mut node = Node::new(name(), ADDRESS);
    let frames = sent(&mut node, 0, 240, outputs);
    assert_eq!(frames.len(), 1, "only the claim before the address is claimed");
    let _ = sent(&mut node, 240, 300, outputs);
    assert_eq!(node.address(), Some(ADDRESS));
    node
}

fn times_of(frames: &[(u64, Frame)], pgn: Pgn) -> Vec<u64> {
    frames.iter().filter(|(_, f)| f.id().pgn() == pgn).map(|(t, _)| *t).collect()
}

#[test]
fn periodic_messages_keep_their_periods() {
    let (estimate, faults) = (estimate(), FaultMemory::new());
    let outputs = outputs(&estimate, &faults);
    let mut node = claimed(&outputs);
    let frames = sent(&mut node, 1000, 6000, &outputs);
    for message in [&c::LEAKAGE, &c::LEAKAGE_SE, &c::EFFICIENCY, &c::VALIDITY, &c::STATUS] {
        let times = times_of(&frames, message.pgn);
        assert_eq!(times.len() as u64, 5000 / u64::from(message.period_ms), "{}", message.name);
        let steady = times.windows(2).all(|w| w[1] - w[0] == u64::from(message.period_ms));
        assert!(steady, "{}: {times:?}", message.name);
    }
    assert!(times_of(&frames, c::HEALTH.pgn).is_empty(), "no health is learned here");
    assert!(times_of(&frames, c::DM1.pgn).is_empty(), "no fault, no DM1");
}

#[test]
fn invalid_part_is_not_available_and_its_reason_is_sent() {
    let estimate = estimate();
    let leakage = publish::leakage(&estimate);
    let near = |value: Result<f32, Absent>, wanted: f32, step: f32| {
        (value.unwrap() - wanted).abs() <= 0.5 * step + 1e-6
    };
    assert!(near(c::KOU_EXPECTED.value(&leakage), 0.08, c::KOU_EXPECTED.scale));
    assert_eq!(c::KOU_SEEN.value(&leakage), Err(Absent::NotAvailable));
    let validity = publish::validity(&estimate, 7);
    assert_eq!(c::EXPECTED_REASON.raw(&validity), Ok(0));
    assert_eq!(c::EXPECTED_CHANNEL.raw(&validity), Err(Absent::NotAvailable));
    let names = |signal: &signal::Signal| {
        let raw = signal.raw(&validity).unwrap();
        signal.values.iter().find(|(number, _)| *number == raw).unwrap().1
    };
    assert_eq!(
        (names(&c::SEEN_REASON), names(&c::SEEN_CHANNEL), names(&c::SEEN_FAULT)),
        ("sensor", "motor speed", "stuck")
    );
    assert_eq!(c::WEAR_RATIO.value(&validity), Err(Absent::NotAvailable));
    // The largest coefficient that a calibration may allow, to a step or f32 rounding; a number beyond the signal's
    // range is an error, not clamped.
    let mut large = estimate;
    large.expected.as_mut().unwrap().kou = LeakageCoefficient(100.0);
    let sent_kou = c::KOU_EXPECTED.value(&publish::leakage(&large)).unwrap();
    assert!((sent_kou - 100.0).abs() <= 1e-5, "{sent_kou}");
    large.expected.as_mut().unwrap().kou = LeakageCoefficient(5000.0);
    assert_eq!(c::KOU_EXPECTED.value(&publish::leakage(&large)), Err(Absent::Error));
}

#[test]
fn active_faults_are_sent_every_second_and_once_after_they_have_healed() {
    let estimate = estimate();
    let mut faults = FaultMemory::new();
    let mut node = claimed(&outputs(&estimate, &faults));
    faults.confirm(FaultCode::Sensor(Channel::MotorSpeed, Fault::Stuck), FreezeFrame::at(1));
    let frames = sent(&mut node, 1000, 5000, &outputs(&estimate, &faults));
    let dm1: Vec<&Frame> = frames.iter().map(|(_, f)| f).filter(|f| f.id().pgn() == c::DM1.pgn).collect();
    assert_eq!(dm1.len(), 4);
    assert_eq!(dm1[0].data(), [4, 0xFF, 191, 0, 7, 1, 0xFF, 0xFF]);
    faults.heal(FaultCode::Sensor(Channel::MotorSpeed, Fault::Stuck));
    let frames = sent(&mut node, 5000, 9000, &outputs(&estimate, &faults));
    let dm1: Vec<&Frame> = frames.iter().map(|(_, f)| f).filter(|f| f.id().pgn() == c::DM1.pgn).collect();
    assert_eq!(dm1.len(), 1);
    assert_eq!(dm1[0].data(), [0, 0xFF, 0, 0, 0, 0, 0xFF, 0xFF]);
}

#[test]
fn requests_are_answered_or_rejected() {
    let estimate = estimate();
    let mut faults = FaultMemory::new();
    for code in FaultCode::all().take(5) {
        faults.record_event(code, FreezeFrame::at(1));
    }
    let outputs = outputs(&estimate, &faults);
    let mut node = claimed(&outputs);
    let request = |pgn: Pgn, destination: u8| {
        Frame::of(Id::new(6, c::REQUEST.pgn, destination, 0xF9), &pgn.to_le_bytes()).unwrap()
    };
    // Five previous trouble codes take 22 bytes: announcement and four packets.
    assert_eq!(node.receive(ms(1000), &request(c::DM2.pgn, ADDRESS)), Received::Handled);
    let frames = sent(&mut node, 1000, 2000, &outputs);
    assert_eq!(times_of(&frames, c::TP_CM.pgn), [1000]);
    assert_eq!(times_of(&frames, c::TP_DT.pgn), [1050, 1100, 1150, 1200]);
    let _ = node.receive(ms(2000), &request(Pgn::new(65253), ADDRESS));
    let nack = node.poll(ms(2000), &outputs).unwrap();
    assert_eq!(nack.id().raw(), 0x18E8_FF27);
    assert_eq!(nack.data(), [1, 0xFF, 0xFF, 0xFF, 0xF9, 0xE5, 0xFE, 0x00]);
    // A global request for an unknown group is not answered; a request to another node is ignored.
    let _ = sent(&mut node, 2000, 2010, &outputs);
    let _ = node.receive(ms(2010), &request(Pgn::new(65253), GLOBAL));
    assert_eq!(node.receive(ms(2010), &request(c::DM1.pgn, 0x28)), Received::Nothing);
    assert!(node.poll(ms(2010), &outputs).is_none());
    let _ = node.receive(ms(2020), &request(c::ADDRESS_CLAIMED.pgn, GLOBAL));
    assert_eq!(node.poll(ms(2020), &outputs).unwrap().id().raw(), 0x18EE_FF27);
}

#[test]
fn a_lost_address_is_no_longer_used() {
    let estimate = estimate();
    let mut faults = FaultMemory::new();
    for code in FaultCode::all().take(5) {
        faults.confirm(code, FreezeFrame::at(1));
    }
    let outputs = outputs(&estimate, &faults);
    let mut node = claimed(&outputs);
    let stronger = Name::new(&NameConfig::transmission(999)).unwrap().to_bytes();
    let claim = Frame::new(Id::new(6, c::ADDRESS_CLAIMED.pgn, GLOBAL, ADDRESS), stronger);
    assert_eq!(node.receive(ms(1000), &claim), Received::Handled);
    let frames = sent(&mut node, 1000, 3000, &outputs);
    assert!(frames.iter().all(|(_, f)| f.id().source() == 128));
    assert_eq!(frames[0].1.id().pgn(), c::ADDRESS_CLAIMED.pgn);
    assert!(frames[1].0 >= 1250, "nothing before the new address is claimed");
}
