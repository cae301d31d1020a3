//! The CAN bus as one to be told: what comes is taken in, what is due goes out, troubles are remembered.
//!
//! Each turn takes a bounded number of frames, so a bus that babbles costs a bounded time; what a driver's queue does not
//! hold is lost there. Frames that carry a step of a calibration update are not obeyed yet.

use kou_estimator::reading::Channel;
use kou_estimator::units::{Celsius, Micros};
use kou_estimator::{Estimate, Fault, Reading, Reason, Sample};

use super::{NoEstimate, Publish};
use crate::faults::{Code, FaultMemory, Snapshot};
use crate::j1939::{CalibrationSource, CalibrationState, DriveReadings, Frame, Node, Outputs};

/// Frames taken in one turn: at 250 kbit/s some two come in a millisecond.
const MAX_IN: usize = 32;
/// Frames sent in one turn.
const MAX_OUT: usize = 8;
/// Silence of the whole bus after which it is a trouble.
const SILENT: Micros = Micros(5_000_000);

/// A CAN driver with queues.
pub trait CanPort {
    /// The next frame that has come.
    fn receive(&mut self) -> Option<Frame>;

    /// Puts a frame into the queue of those to be sent; false when there is no room.
    fn send(&mut self, frame: &Frame) -> bool;
}

/// The controller on its bus.
#[derive(Debug)]
pub struct Bus<P> {
    port: P,
    node: Node,
    faults: FaultMemory,
    failed: [Option<Fault>; Channel::ALL.len()],
    started: Option<Micros>,
    dropped: u32,
    drive: Option<DriveReadings>,
}

impl<P: CanPort> Bus<P> {
    /// A controller that will claim its address on this bus.
    pub const fn new(port: P, node: Node) -> Self {
        Self {
            port,
            node,
            faults: FaultMemory::new(),
            failed: [None; Channel::ALL.len()],
            started: None,
            dropped: 0,
            drive: None,
        }
    }

    /// The same, with the oil temperature that the controller at `source` sends (SPN 177) as a check of the own thermometer.
    /// Nobody else is listened to: a reading that anybody may send would be a way to silence the estimates.
    #[must_use]
    pub fn hearing_oil_from(self, source: u8) -> Self {
        Self { drive: Some(DriveReadings::new(Some(source))), ..self }
    }

    /// Troubles since the start.
    #[must_use]
    pub const fn faults(&self) -> &FaultMemory {
        &self.faults
    }

    /// Frames that the driver had no room for.
    #[must_use]
    pub const fn dropped(&self) -> u32 {
        self.dropped
    }

    #[cfg(test)]
    pub(super) const fn port(&self) -> &P {
        &self.port
    }

    #[cfg(test)]
    pub(super) const fn port_mut(&mut self) -> &mut P {
        &mut self.port
    }

    fn remember(&mut self, now: Micros, sample: Option<&Sample>) {
        let seconds = u32::try_from(now.0 / 1_000_000).unwrap_or(u32::MAX);
        let snapshot = sample.map_or(Snapshot::at(seconds), |sample| Snapshot::of(seconds, sample));
        if let Some(sample) = sample {
            for (channel, before) in Channel::ALL.into_iter().zip(&mut self.failed) {
                let fault = fault_of(sample, channel);
                if fault == *before {
                    continue;
                }
                if let Some(fault) = *before {
                    self.faults.healed(Code::Sensor(channel, fault));
                }
                if let Some(fault) = fault {
                    self.faults.confirmed(Code::Sensor(channel, fault), snapshot);
                }
                *before = fault;
            }
        }
        let since = self.node.heard().unwrap_or(*self.started.get_or_insert(now));
        let states = [
            (Code::BusSilent, now.0.saturating_sub(since.0) > SILENT.0),
            (Code::AddressLost, self.node.is_silenced()),
        ];
        for (code, is_there) in states {
            if is_there {
                self.faults.confirmed(code, snapshot);
            } else {
                self.faults.healed(code);
            }
        }
    }
}

/// What is wrong with a channel; a sensor that is not fitted is no trouble.
fn fault_of(sample: &Sample, channel: Channel) -> Option<Fault> {
    let fault = match channel {
        Channel::PumpSpeed => sample.pump_speed.value.err(),
        Channel::MotorSpeed => sample.motor_speed.value.err(),
        Channel::HighPressure => sample.high_pressure.value.err(),
        Channel::LowPressure => sample.low_pressure.value.err(),
        Channel::OilTemperature => sample.oil_temperature.value.err(),
        Channel::Displacement => sample.displacement.value.err(),
        Channel::Flow => sample.flow.value.err(),
    };
    fault.filter(|fault| *fault != Fault::NotFitted)
}

impl<P: CanPort> Publish for Bus<P> {
    async fn publish(
        &mut self,
        now: Micros,
        estimate: &Result<Estimate, NoEstimate>,
        sample: Option<&Sample>,
    ) {
        for _ in 0..MAX_IN {
            let Some(frame) = self.port.receive() else { break };
            self.node.receive(now, &frame);
            if let Some(drive) = &mut self.drive {
                drive.receive(now, &frame);
            }
        }
        self.remember(now, sample);
        // Without any estimate there is none that is valid: told as of readings that have not come.
        let missing = Estimate::invalid(now, Reason::Sensor(Channel::PumpSpeed, Fault::Missing));
        let source = match estimate {
            Err(NoEstimate::NoCalibration) => CalibrationSource::None,
            _ => CalibrationSource::Default,
        };
        let outputs = Outputs {
            estimate: estimate.as_ref().unwrap_or(&missing),
            health: None,
            calibration: CalibrationState { source, crc: 0 },
            faults: &self.faults,
        };
        for _ in 0..MAX_OUT {
            let Some(frame) = self.node.poll(now, &outputs) else { break };
            if !self.port.send(&frame) {
                self.dropped = self.dropped.saturating_add(1);
            }
        }
    }

    fn oil_heard(&self, now: Micros) -> Reading<Celsius> {
        self.drive.as_ref().map_or(Reading::not_fitted(), |drive| drive.oil_temperature(now))
    }
}
