//! CAN interface of the publishing task: receives frames, sends those that are due, records bus and sensor faults.
//!
//! Each cycle handles a bounded number of frames, so a babbling node costs bounded time; frames beyond the driver's
//! queue are lost. Frames of a calibration update are forwarded to the storage task, whose answers leave in the next
//! cycle.

use embassy_sync::blocking_mutex::raw::RawMutex;
use kou_estimator::reading::Channel;
use kou_estimator::units::{Celsius, Micros};
use kou_estimator::{Estimate, Fault, Reading, Reason, Sample};

use super::publish::Publish;
use super::shared::{Controller, NoEstimate};
use crate::diagnostics::{FaultCode, FreezeFrame};
use crate::j1939::{DriveReadings, Frame, Node, Outputs, Received};
use crate::log::info;

/// Frames received per cycle at most: at 250 kbit/s about two arrive per millisecond.
const MAX_IN: usize = 32;
/// Frames sent per cycle at most.
const MAX_OUT: usize = 8;
/// Silence of the whole bus after which a fault is recorded.
const SILENT: Micros = Micros(5_000_000);

/// Queued CAN driver.
pub trait CanPort {
    /// Takes the next received frame.
    fn receive(&mut self) -> Option<Frame>;

    /// Queues a frame for sending; returns false when the queue is full.
    fn send(&mut self, frame: &Frame) -> bool;
}

/// CAN interface of the controller: J1939 node, driver and fault recording.
pub struct CanInterface<'c, P, M: RawMutex> {
    port: P,
    node: Node,
    controller: &'c Controller<M>,
    failed: [Option<Fault>; Channel::ALL.len()],
    started: Option<Micros>,
    dropped: u32,
    drive: Option<DriveReadings>,
}

impl<'c, P: CanPort, M: RawMutex> CanInterface<'c, P, M> {
    /// Interface that will claim its address on this bus.
    pub const fn new(port: P, node: Node, controller: &'c Controller<M>) -> Self {
        Self {
            port,
            node,
            controller,
            failed: [None; Channel::ALL.len()],
            started: None,
            dropped: 0,
            drive: None,
        }
    }

    /// Adds the oil temperature (SPN 177) sent by the controller at `source` as a check of the controller's own
    /// thermometer. Frames of other sources are ignored: otherwise any node could invalidate the estimates.
    #[must_use]
    pub fn with_external_oil_temperature(self, source: u8) -> Self {
        Self { drive: Some(DriveReadings::new(Some(source))), ..self }
    }

    /// Number of frames dropped because the driver's queue was full.
    #[must_use]
    pub const fn dropped(&self) -> u32 {
        self.dropped
    }

    fn remember(&mut self, now: Micros, estimate: Option<&Estimate>, sample: Option<&Sample>) {
        let seconds = self.controller.operating_s(now);
        let snapshot = sample.map_or(FreezeFrame::at(seconds), |sample| FreezeFrame::of(seconds, sample));
        let since = self.node.last_received().unwrap_or(*self.started.get_or_insert(now));
        let is_silent = now.0.saturating_sub(since.0) > SILENT.0;
        let is_lost = self.node.is_address_lost();
        let failed = &mut self.failed;
        let mut confirmed = [None; Channel::ALL.len()];
        self.controller.faults(|faults| {
            for ((channel, before), confirmed) in Channel::ALL.into_iter().zip(failed).zip(&mut confirmed) {
                let Some(sample) = sample else { break };
                let fault = fault_of(sample, channel);
                if fault == *before {
                    continue;
                }
                if let Some(fault) = *before {
                    faults.heal(FaultCode::Sensor(channel, fault));
                }
                if let Some(fault) = fault {
                    faults.confirm(FaultCode::Sensor(channel, fault), snapshot);
                    *confirmed = Some(FaultCode::Sensor(channel, fault));
                }
                *before = fault;
            }
            if let Some(estimate) = estimate {
                faults.set_status(FaultCode::Wear, estimate.health.wear, snapshot);
                faults.set_status(FaultCode::SensorSuspect, estimate.health.sensor, snapshot);
            }
            for (code, is_there) in [(FaultCode::BusSilent, is_silent), (FaultCode::AddressLost, is_lost)] {
                if is_there {
                    faults.confirm(code, snapshot);
                } else {
                    faults.heal(code);
                }
            }
        });
        // Logged after the lock is released, because writing a log takes long.
        for code in confirmed.into_iter().flatten() {
            info!("fault {}", code);
        }
    }

    fn send(&mut self, frame: &Frame) {
        if !self.port.send(frame) {
            self.dropped = self.dropped.saturating_add(1);
        }
    }
}

/// Fault of a channel; a sensor that is not fitted has none.
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

impl<P: CanPort, M: RawMutex> Publish for CanInterface<'_, P, M> {
    async fn publish(
        &mut self,
        now: Micros,
        estimate: &Result<Estimate, NoEstimate>,
        sample: Option<&Sample>,
    ) {
        for _ in 0..MAX_IN {
            let Some(frame) = self.port.receive() else { break };
            if let Received::Update { source, data } = self.node.receive(now, &frame) {
                // A tool that does not wait for its answers loses commands, and receives a rejection for the missing
                // segment.
                self.controller.commands.try_send((source, data)).ok();
            }
            if let Some(drive) = &mut self.drive {
                drive.receive(now, &frame);
            }
        }
        self.remember(now, estimate.as_ref().ok(), sample);
        while let Ok((tool, answer)) = self.controller.answers.try_receive() {
            if let Some(frame) = self.node.update_answer(tool, answer) {
                self.send(&frame);
            }
        }
        // Without any estimate, publish an invalid one whose reason is a missing reading.
        let missing = Estimate::invalid(now, Reason::Sensor(Channel::PumpSpeed, Fault::Missing));
        let outputs = Outputs {
            estimate: estimate.as_ref().unwrap_or(&missing),
            health: estimate.as_ref().ok().map(|estimate| &estimate.health),
            calibration: self.controller.calibration().unwrap_or_default(),
            dtcs: self.controller.faults(|faults| faults.reports()),
        };
        for _ in 0..MAX_OUT {
            let Some(frame) = self.node.poll(now, &outputs) else { break };
            self.send(&frame);
        }
    }

    fn external_oil_temperature(&self, now: Micros) -> Reading<Celsius> {
        self.drive.as_ref().map_or(Reading::not_fitted(), |drive| drive.oil_temperature(now))
    }
}

#[cfg(test)]
mod tests {
    use std::vec;
    use std::vec::Vec;

    use embassy_sync::blocking_mutex::raw::NoopRawMutex;

    use super::*;
    use crate::j1939::{Id, Name, NameConfig};

    /// Bus in memory: frames to receive, frames sent, and room for further frames.
    struct CanBench {
        received: Vec<Frame>,
        sent: Vec<Frame>,
        room: usize,
    }

    impl CanPort for CanBench {
        fn receive(&mut self) -> Option<Frame> {
            self.received.pop()
        }

        fn send(&mut self, frame: &Frame) -> bool {
            if self.sent.len() >= self.room {
                return false;
            }
            self.sent.push(*frame);
            true
        }
    }

    type Shared = Controller<NoopRawMutex>;

    fn bus(controller: &Shared, room: usize) -> CanInterface<'_, CanBench, NoopRawMutex> {
        let name = Name::new(&NameConfig::transmission(1)).unwrap();
        CanInterface::new(
            CanBench { received: Vec::new(), sent: Vec::new(), room },
            Node::new(name, 0x8C),
            controller,
        )
    }

    fn cycle(bus: &mut CanInterface<'_, CanBench, NoopRawMutex>, ms: u64, sample: Option<&Sample>) {
        let none = Err(NoEstimate::NoCalibration);
        embassy_futures::block_on(bus.publish(Micros(ms * 1000), &none, sample));
    }

    #[test]
    fn the_node_claims_its_address_and_publishes_even_without_an_estimate() {
        let controller = Shared::new();
        let mut bus = bus(&controller, usize::MAX);
        for ms in (0..3_000).step_by(10) {
            cycle(&mut bus, ms, None);
        }
        let sent = &bus.port.sent;
        assert_eq!(sent.first().map(|frame| frame.id().pgn().get()), Some(60928), "address claimed");
        assert!(sent.len() > 30 && sent.iter().all(|frame| frame.id().source() == 0x8C), "{}", sent.len());
    }

    #[test]
    fn a_failed_sensor_is_an_active_fault_until_it_heals_and_then_a_previous_one() {
        let controller = Shared::new();
        let mut bus = bus(&controller, usize::MAX);
        let mut sample = Sample::empty(Micros(0));
        sample.pump_speed = Reading::failed(Micros(0), Fault::Open);
        cycle(&mut bus, 0, Some(&sample));
        let code = FaultCode::Sensor(Channel::PumpSpeed, Fault::Open);
        assert!(controller.faults(|memory| memory.active().any(|entry| entry.code() == Some(code))));
        sample.pump_speed = Reading::new(Micros(0), kou_estimator::units::RevPerMin(1000.0));
        cycle(&mut bus, 10, Some(&sample));
        assert!(controller.faults(|memory| memory.active().all(|entry| entry.code() != Some(code))));
        assert!(controller.faults(|memory| memory.previous().any(|entry| entry.code() == Some(code))));
    }

    #[test]
    fn a_silent_bus_is_a_fault_after_five_seconds_and_one_frame_heals_it() {
        let controller = Shared::new();
        let mut bus = bus(&controller, usize::MAX);
        let is_active =
            || controller.faults(|memory| memory.active().any(|e| e.code() == Some(FaultCode::BusSilent)));
        for ms in (0..=5_000).step_by(10) {
            cycle(&mut bus, ms, None);
            assert!(!is_active(), "{ms}");
        }
        cycle(&mut bus, 5_010, None);
        assert!(is_active());
        bus.port.received.push(Frame::new(Id::from_raw(0x0CF0_0203), [0xFF; 8]));
        cycle(&mut bus, 5_020, None);
        assert!(!is_active());
    }

    #[test]
    fn frames_without_room_are_counted_and_a_flood_costs_a_bounded_cycle() {
        let controller = Shared::new();
        let mut bus = bus(&controller, 1);
        bus.port.received = vec![Frame::new(Id::from_raw(0x18EA_FFF9), [0; 8]); 1000];
        for ms in (0..1_000).step_by(10) {
            let before = bus.port.received.len();
            cycle(&mut bus, ms, None);
            assert!(before - bus.port.received.len() <= 32);
        }
        assert_eq!(bus.port.sent.len(), 1);
        assert!(bus.dropped() > 0);
    }
}
