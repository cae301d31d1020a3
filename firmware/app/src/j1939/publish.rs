//! Encoding of estimates and health as messages of the [catalogue](super::catalogue).

use kou_estimator::health::{Cause, DtcStatus, GateClosed, Health};
use kou_estimator::model::calibrated_region::Direction;
use kou_estimator::{Channel, Estimate, Expected, Fault, Observed, Reason};

use super::catalogue as c;
use super::signal::{Absent, Signal};
use crate::calibration::{CalibrationSource, CalibrationState};

/// Initial bytes of a message: unused bits are ones.
const BLANK: [u8; 8] = [0xFF; 8];

/// Number of a reason in [`c::REASONS`].
#[must_use]
pub const fn reason_code(reason: Reason) -> u32 {
    match reason {
        Reason::Sensor(..) => 1,
        Reason::TimeReversed => 2,
        Reason::SpeedTooLow => 3,
        Reason::DisplacementTooSmall => 4,
        Reason::NotLoaded => 5,
        Reason::LawNotPositive => 6,
        Reason::LeakageTakesFlow => 7,
        Reason::RatioNotPositive => 8,
        Reason::RatioAboveLeakFree => 9,
        Reason::KouImplausible => 10,
        Reason::SensorSuspected => 11,
        Reason::OutsideRegion(direction) => 16 + direction_code(direction),
    }
}

const fn direction_code(direction: Direction) -> u32 {
    match direction {
        Direction::Speed => 0,
        Direction::Pressure => 1,
        Direction::Temperature => 2,
        Direction::SpeedPlusPressure => 3,
        Direction::SpeedMinusPressure => 4,
        Direction::SpeedPlusTemperature => 5,
        Direction::SpeedMinusTemperature => 6,
        Direction::PressurePlusTemperature => 7,
        Direction::PressureMinusTemperature => 8,
    }
}

const fn channel_code(channel: Channel) -> u32 {
    match channel {
        Channel::PumpSpeed => 0,
        Channel::HighPressure => 1,
        Channel::LowPressure => 2,
        Channel::OilTemperature => 3,
        Channel::Displacement => 4,
        Channel::MotorSpeed => 5,
        Channel::Flow => 6,
    }
}

const fn fault_code(fault: Fault) -> u32 {
    match fault {
        Fault::NotFitted => 0,
        Fault::Missing => 1,
        Fault::Open => 2,
        Fault::Short => 3,
        Fault::Stale => 4,
        Fault::Future => 5,
        Fault::OutOfRange => 6,
        Fault::NotFinite => 7,
        Fault::Stuck => 8,
        Fault::Rate => 9,
        Fault::Implausible => 10,
    }
}

const fn stage_code(stage: DtcStatus) -> u32 {
    match stage {
        DtcStatus::Absent => 0,
        DtcStatus::Pending => 1,
        DtcStatus::Confirmed => 2,
        DtcStatus::Healed => 3,
    }
}

const fn gate_code(gate: Result<(), GateClosed>) -> u32 {
    match gate {
        Ok(()) => 0,
        Err(GateClosed::Sample(_)) => 1,
        Err(GateClosed::Filling) => 2,
        Err(GateClosed::AfterGap) => 3,
        Err(GateClosed::SpeedUnsteady) => 4,
        Err(GateClosed::PressureUnsteady) => 5,
        Err(GateClosed::DisplacementUnsteady) => 6,
        Err(GateClosed::RatioUnsteady) => 7,
    }
}

/// Writes a number of a valid part; the reason of an invalid one is in [`validity`].
fn put<T>(data: &mut [u8; 8], signal: &Signal, part: &Result<T, Reason>, number: impl Fn(&T) -> f32) {
    signal.put(data, part.as_ref().map(number).map_err(|_| Absent::NotAvailable));
}

/// Message [`c::LEAKAGE`].
#[must_use]
pub fn leakage(estimate: &Estimate) -> [u8; 8] {
    let mut data = BLANK;
    put(&mut data, &c::KOU_EXPECTED, &estimate.expected, |e: &Expected| e.kou.get());
    put(&mut data, &c::KOU_SEEN, &estimate.observed, |s: &Observed| s.kou.get());
    data
}

/// Message [`c::LEAKAGE_SE`].
#[must_use]
pub fn leakage_se(estimate: &Estimate) -> [u8; 8] {
    let mut data = BLANK;
    put(&mut data, &c::KOU_EXPECTED_SE, &estimate.expected, |e: &Expected| e.kou_se.get());
    put(&mut data, &c::KOU_SEEN_SE, &estimate.observed, |s: &Observed| s.kou_se.get());
    data
}

/// Message [`c::EFFICIENCY`].
#[must_use]
pub fn efficiency(estimate: &Estimate) -> [u8; 8] {
    let mut data = BLANK;
    let (expected, seen) = (&estimate.expected, &estimate.observed);
    put(&mut data, &c::EFFICIENCY_EXPECTED, expected, |e: &Expected| 100.0 * e.volumetric_efficiency.get());
    put(&mut data, &c::EFFICIENCY_SEEN, seen, |s: &Observed| 100.0 * s.volumetric_efficiency.get());
    put(&mut data, &c::FLOW_EXPECTED, expected, |e: &Expected| e.leakage.get());
    put(&mut data, &c::FLOW_SEEN, seen, |s: &Observed| s.leakage.get());
    data
}

fn put_reason(data: &mut [u8; 8], [reason, channel, fault]: [&Signal; 3], why: Option<Reason>) {
    reason.put_raw(data, why.map_or(0, reason_code));
    if let Some(Reason::Sensor(of, what)) = why {
        channel.put_raw(data, channel_code(of));
        fault.put_raw(data, fault_code(what));
    }
}

/// Message [`c::VALIDITY`]; `counter` is its sequence counter.
#[must_use]
pub fn validity(estimate: &Estimate, counter: u8) -> [u8; 8] {
    let mut data = BLANK;
    let expected = [&c::EXPECTED_REASON, &c::EXPECTED_CHANNEL, &c::EXPECTED_FAULT];
    put_reason(&mut data, expected, estimate.expected.err());
    put_reason(&mut data, [&c::SEEN_REASON, &c::SEEN_CHANNEL, &c::SEEN_FAULT], estimate.observed.err());
    put(&mut data, &c::WEAR_RATIO, &estimate.wear_ratio(), |ratio| ratio.get());
    c::ESTIMATE_COUNTER.put_raw(&mut data, u32::from(counter));
    data
}

/// Message [`c::HEALTH`].
#[must_use]
pub fn health(health: &Health) -> [u8; 8] {
    let mut data = BLANK;
    c::LEVEL.put(&mut data, Ok(health.level.get()));
    c::LEVEL_SE.put(&mut data, Ok(health.level_se.get()));
    c::RATIO_OFFSET.put(&mut data, Ok(health.ratio_offset.get()));
    c::WEAR_STAGE.put_raw(&mut data, stage_code(health.wear));
    c::SENSOR_STAGE.put_raw(&mut data, stage_code(health.sensor));
    c::GATE.put_raw(&mut data, gate_code(health.gate));
    data
}

/// Message [`c::STATUS`].
#[must_use]
pub fn status(calibration: CalibrationState, health: Option<&Health>) -> [u8; 8] {
    let mut data = BLANK;
    c::CALIBRATION_CRC.put_raw(&mut data, calibration.crc);
    let source = match calibration.source {
        CalibrationSource::None => 0,
        CalibrationSource::Default => 1,
        CalibrationSource::Stored => 2,
    };
    c::CALIBRATION_SOURCE.put_raw(&mut data, source);
    c::CHANGES.put_raw(&mut data, u32::from(health.map_or(0, |h| h.changes).min(255)));
    let remaining = |h: &Health| {
        Cause::ALL
            .into_iter()
            .enumerate()
            .filter(|(_, cause)| h.causes.contains(*cause))
            .fold(0, |bits, (place, _)| bits | 1_u32.wrapping_shl(place as u32))
    };
    c::CAUSES.put_raw(&mut data, health.map_or(0, remaining));
    data
}
