//! Readings received from the drive's other controllers: shaft speeds, pressure and oil temperature, for machines
//! whose controller has no own sensors for them.
//!
//! A reading has the time of its frame. Raw values without a value become reasons: "not available" is
//! [`Fault::Missing`], "error" and reserved values are [`Fault::OutOfRange`]. A message absent for five of its
//! periods makes its readings [`Fault::Stale`]; a message never received, [`Fault::Missing`].

use kou_estimator::units::{Celsius, Megapascal, Micros, RevPerMin};
use kou_estimator::{Fault, Reading};

use super::catalogue::{
    ETC1, HPG, HYDRAULIC_PRESSURE, INPUT_SHAFT_SPEED, OIL_TEMPERATURE, OUTPUT_SHAFT_SPEED, TRF1,
};
use super::id::Frame;
use super::signal::{Absent, Message};

/// Periods for which a message may be absent.
const PERIODS_UNTIL_STALE: u64 = 5;

/// Timeout after which the readings of a message are stale.
#[must_use]
pub const fn time_out(message: &Message) -> Micros {
    Micros(PERIODS_UNTIL_STALE * 1000 * message.period_ms as u64)
}

/// Latest readings from the bus.
#[derive(Debug, Clone, PartialEq)]
pub struct DriveReadings {
    from: Option<u8>,
    pump_speed: Reading<RevPerMin>,
    motor_speed: Reading<RevPerMin>,
    high_pressure: Reading<Megapascal>,
    oil_temperature: Reading<Celsius>,
}

const fn fault_of(absent: Absent) -> Fault {
    match absent {
        Absent::NotAvailable => Fault::Missing,
        Absent::Error | Absent::Reserved => Fault::OutOfRange,
    }
}

fn never<U>() -> Reading<U> {
    Reading::failed(Micros(0), Fault::Missing)
}

/// Reading at `now`. A message never received remains missing.
fn aged<U: Copy>(reading: &Reading<U>, message: &Message, now: Micros) -> Reading<U> {
    let is_late = now.0.saturating_sub(reading.time.0) > time_out(message).0;
    let was_received = reading.value.is_ok() || reading.time.0 > 0;
    if is_late && was_received { Reading::failed(now, Fault::Stale) } else { *reading }
}

impl DriveReadings {
    /// No readings yet. With `from`, only frames of that source address are accepted; without, of any.
    #[must_use]
    pub fn new(from: Option<u8>) -> Self {
        Self {
            from,
            pump_speed: never(),
            motor_speed: never(),
            high_pressure: never(),
            oil_temperature: never(),
        }
    }

    /// Processes a frame; returns whether it contained readings. Frames that are too short or from another source are
    /// ignored.
    pub fn receive(&mut self, now: Micros, frame: &Frame) -> bool {
        let Some(data) = frame.full() else { return false };
        if self.from.is_some_and(|from| from != frame.id().source()) {
            return false;
        }
        let pgn = frame.id().pgn();
        let speed =
            |raw: Result<f32, Absent>| Reading { time: now, value: raw.map(RevPerMin).map_err(fault_of) };
        if pgn == ETC1.pgn {
            self.pump_speed = speed(INPUT_SHAFT_SPEED.value(data));
            self.motor_speed = speed(OUTPUT_SHAFT_SPEED.value(data));
        } else if pgn == HPG.pgn {
            let value = HYDRAULIC_PRESSURE.value(data).map(|kpa| Megapascal(1e-3 * kpa)).map_err(fault_of);
            self.high_pressure = Reading { time: now, value };
        } else if pgn == TRF1.pgn {
            let value = OIL_TEMPERATURE.value(data).map(Celsius).map_err(fault_of);
            self.oil_temperature = Reading { time: now, value };
        } else {
            return false;
        }
        true
    }

    /// Pump speed (SPN 161).
    #[must_use]
    pub fn pump_speed(&self, now: Micros) -> Reading<RevPerMin> {
        aged(&self.pump_speed, &ETC1, now)
    }

    /// Motor speed (SPN 191), with the sign of the displacement: the bus carries the magnitude only.
    #[must_use]
    pub fn motor_speed(&self, now: Micros, displacement_is_negative: bool) -> Reading<RevPerMin> {
        let Reading { time, value } = aged(&self.motor_speed, &ETC1, now);
        let sign = if displacement_is_negative { -1.0 } else { 1.0 };
        Reading { time, value: value.map(|n| RevPerMin(sign * n.get())) }
    }

    /// Pressure of the high line (SPN 1762), gauge.
    #[must_use]
    pub fn high_pressure(&self, now: Micros) -> Reading<Megapascal> {
        aged(&self.high_pressure, &HPG, now)
    }

    /// Oil temperature (SPN 177). It is sent once a second, less often than most calibrations accept; oil changes by
    /// a fraction of a kelvin in that time, so a value is stamped `now` until its message is late.
    #[must_use]
    pub fn oil_temperature(&self, now: Micros) -> Reading<Celsius> {
        match aged(&self.oil_temperature, &TRF1, now) {
            Reading { value: Ok(value), .. } => Reading::new(now, value),
            failed => failed,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::id::{GLOBAL, Id};
    use super::super::signal::Signal;
    use super::*;

    fn frame(message: &Message, source: u8, values: &[(Signal, Result<f32, Absent>)]) -> Frame {
        let mut data = [0xFF; 8];
        for (signal, value) in values {
            signal.put(&mut data, *value);
        }
        Frame::new(Id::new(message.priority, message.pgn, GLOBAL, source), data)
    }

    #[test]
    fn readings_have_value_and_time_of_their_frames() {
        let mut drive = DriveReadings::new(Some(3));
        let now = Micros(1_000_000);
        assert_eq!(drive.pump_speed(now).value, Err(Fault::Missing));
        let etc1 = [(INPUT_SHAFT_SPEED, Ok(1500.125)), (OUTPUT_SHAFT_SPEED, Ok(1400.0))];
        assert!(drive.receive(now, &frame(&ETC1, 3, &etc1)));
        assert!(drive.receive(now, &frame(&HPG, 3, &[(HYDRAULIC_PRESSURE, Ok(35_000.0))])));
        assert!(drive.receive(now, &frame(&TRF1, 3, &[(OIL_TEMPERATURE, Ok(-12.5))])));
        assert_eq!(drive.pump_speed(now), Reading::new(now, RevPerMin(1500.125)));
        assert_eq!(drive.motor_speed(now, true), Reading::new(now, RevPerMin(-1400.0)));
        assert!((drive.high_pressure(now).value.unwrap().get() - 35.0).abs() < 1e-5, "f32 rounding");
        let later = Micros(now.0 + 900_000);
        assert_eq!(drive.oil_temperature(later), Reading::new(later, Celsius(-12.5)));
        // From another source, and too short: no effect.
        let before = drive.clone();
        assert!(!drive.receive(now, &frame(&HPG, 4, &[(HYDRAULIC_PRESSURE, Ok(1.0))])));
        let short = Frame::of(Id::new(3, HPG.pgn, GLOBAL, 3), &[0; 7]).unwrap();
        assert!(!drive.receive(now, &short));
        assert_eq!(drive, before);
    }

    #[test]
    fn absent_messages_make_their_readings_stale_after_five_periods() {
        let mut drive = DriveReadings::new(None);
        let start = Micros(1_000_000);
        for message in [&ETC1, &HPG, &TRF1] {
            let _ = drive.receive(start, &Frame::new(Id::new(3, message.pgn, GLOBAL, 0), [0; 8]));
        }
        for (message, stale) in [
            (&ETC1, (|d, t| d.pump_speed(t).value.err()) as fn(&DriveReadings, Micros) -> Option<Fault>),
            (&ETC1, |d, t| d.motor_speed(t, false).value.err()),
            (&HPG, |d, t| d.high_pressure(t).value.err()),
            (&TRF1, |d, t| d.oil_temperature(t).value.err()),
        ] {
            let last = Micros(start.0 + time_out(message).0);
            assert_eq!(stale(&drive, last), None, "{}", message.name);
            assert_eq!(stale(&drive, Micros(last.0 + 1)), Some(Fault::Stale), "{}", message.name);
        }
    }

    #[test]
    fn raw_values_without_a_value_become_reasons() {
        let mut drive = DriveReadings::new(None);
        let now = Micros(5);
        for (why, fault) in [
            (Absent::NotAvailable, Fault::Missing),
            (Absent::Error, Fault::OutOfRange),
            (Absent::Reserved, Fault::OutOfRange),
        ] {
            let _ = drive.receive(now, &frame(&HPG, 3, &[(HYDRAULIC_PRESSURE, Err(why))]));
            assert_eq!(drive.high_pressure(now), Reading::failed(now, fault));
        }
    }
}
