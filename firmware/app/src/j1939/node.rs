//! J1939 node: address claim, requests, periodic messages and diagnostics.
//!
//! It has no driver and no clock: [`Node::receive`] takes a received frame, [`Node::poll`] returns the next frame to
//! send. A received frame causes at most one answer per call, and the amount of pending work is bounded.

use kou_estimator::Estimate;
use kou_estimator::health::Health;
use kou_estimator::units::Micros;

use super::catalogue::{
    ACK_ADDRESS, ACK_CONTROL, ACK_PGN, ACKNOWLEDGEMENT, ADDRESS_CLAIMED, DM1, DM2, EFFICIENCY, HEALTH,
    LEAKAGE, LEAKAGE_SE, REQUEST, STATUS, UPDATE_ANSWER, VALIDITY,
};
use super::claim::AddressClaim;
use super::diagnostic_messages::{self, DtcListKind};
use super::id::{Frame, GLOBAL, Id, Pgn};
use super::name::Name;
use super::publish;
use super::signal::Message;
use super::transport::Broadcast;
use crate::calibration::CalibrationState;
use crate::diagnostics::DtcList;

/// Parameter group of the calibration update (proprietary A), see `crate::update`.
pub const UPDATE: Pgn = UPDATE_ANSWER.pgn;
/// Acknowledgement control byte: the group is not supported.
const NEGATIVE: u32 = 1;

/// Content of the periodic messages.
#[derive(Debug, Clone)]
pub struct Outputs<'a> {
    /// Latest estimate.
    pub estimate: &'a Estimate,
    /// Learned health; without it no health message is sent.
    pub health: Option<&'a Health>,
    /// Calibration in use.
    pub calibration: CalibrationState,
    /// Trouble codes.
    pub dtcs: DtcList,
}

/// Classification of a received frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Received {
    /// Not relevant to this controller.
    Nothing,
    /// Handled by the node.
    Handled,
    /// Command of a calibration update, for `crate::update`.
    Update {
        /// Source address.
        source: u8,
        /// Data bytes.
        data: [u8; 8],
    },
}

/// Periodic messages in the order of sending.
const PERIODIC: [&Message; 6] = [&LEAKAGE, &LEAKAGE_SE, &EFFICIENCY, &VALIDITY, &HEALTH, &STATUS];

/// J1939 node of the controller.
#[derive(Debug, Clone)]
pub struct Node {
    claim: AddressClaim,
    broadcast: Broadcast,
    due: [Micros; PERIODIC.len()],
    dm1_due: Micros,
    /// Whether the last DM1 held a trouble code: one more DM1 is sent after the last fault has healed.
    dm1_held: bool,
    dm1_requested: bool,
    dm2_requested: bool,
    negative_ack: Option<(u8, Pgn)>,
    counter: u8,
    last_received: Option<Micros>,
}

impl Node {
    /// Node that will claim `preferred` (0 to 253).
    #[must_use]
    pub const fn new(name: Name, preferred: u8) -> Self {
        Self {
            claim: AddressClaim::new(name, preferred),
            broadcast: Broadcast::new(),
            due: [Micros(0); PERIODIC.len()],
            dm1_due: Micros(0),
            dm1_held: false,
            dm1_requested: false,
            dm2_requested: false,
            negative_ack: None,
            counter: 0,
            last_received: None,
        }
    }

    /// Source address once claimed.
    #[must_use]
    pub fn address(&self) -> Option<u8> {
        self.claim.address()
    }

    /// Whether every address was lost, which is [`crate::diagnostics::FaultCode::AddressLost`].
    #[must_use]
    pub fn is_address_lost(&self) -> bool {
        self.claim.is_silent()
    }

    /// Time of the last received frame; for [`crate::diagnostics::FaultCode::BusSilent`].
    #[must_use]
    pub fn last_received(&self) -> Option<Micros> {
        self.last_received
    }

    /// Claims the preferred address anew, as after bus-off.
    pub fn restart(&mut self) {
        self.claim.restart();
        self.broadcast.stop();
    }

    /// Processes a received frame.
    pub fn receive(&mut self, now: Micros, frame: &Frame) -> Received {
        self.last_received = Some(now);
        let id = frame.id();
        let is_for_me = id.destination() == GLOBAL || Some(id.destination()) == self.address();
        if id.pgn() == ADDRESS_CLAIMED.pgn && id.destination() == GLOBAL {
            if let Some(name) = frame.full() {
                let had = self.address();
                self.claim.receive(now, id.source(), Name::from_bytes(*name));
                if had.is_some() && self.address().is_none() {
                    // Stop the broadcast under an address that now belongs to another node.
                    self.broadcast.stop();
                }
                return Received::Handled;
            }
        } else if id.pgn() == REQUEST.pgn && is_for_me {
            if let Some(wanted) = frame.data().first_chunk::<3>() {
                self.on_request(now, &id, Pgn::from_le_bytes(*wanted));
                return Received::Handled;
            }
        } else if id.pgn() == UPDATE
            && Some(id.destination()) == self.address()
            && let Some(data) = frame.full()
        {
            return Received::Update { source: id.source(), data: *data };
        }
        Received::Nothing
    }

    /// Frame of an answer of a calibration update; `None` without an address.
    #[must_use]
    pub fn update_answer(&self, tool: u8, answer: [u8; 8]) -> Option<Frame> {
        let source = self.address()?;
        Some(Frame::new(Id::new(UPDATE_ANSWER.priority, UPDATE, tool, source), answer))
    }

    fn on_request(&mut self, now: Micros, id: &Id, wanted: Pgn) {
        if wanted == ADDRESS_CLAIMED.pgn {
            self.claim.on_request(now);
        } else if wanted == DM1.pgn {
            self.dm1_requested = true;
        } else if wanted == DM2.pgn {
            self.dm2_requested = true;
        } else if let Some((_, due)) =
            PERIODIC.iter().zip(&mut self.due).find(|(message, _)| message.pgn == wanted)
        {
            *due = now;
        } else if id.destination() != GLOBAL {
            self.negative_ack = Some((id.source(), wanted));
        }
    }

    /// Next frame to send; to be called until it returns `None`, about every 10 ms.
    pub fn poll(&mut self, now: Micros, outputs: &Outputs<'_>) -> Option<Frame> {
        if let Some(frame) = self.claim.poll(now) {
            return Some(frame);
        }
        let source = self.address()?;
        if let Some((address, pgn)) = self.negative_ack.take() {
            let mut data = [0xFF; 8];
            ACK_CONTROL.put_raw(&mut data, NEGATIVE);
            ACK_ADDRESS.put_raw(&mut data, u32::from(address));
            ACK_PGN.put_raw(&mut data, pgn.get());
            return Some(frame_of(&ACKNOWLEDGEMENT, source, data));
        }
        self.diagnostics(now, source, &outputs.dtcs)
            .or_else(|| self.broadcast.poll(now, source))
            .or_else(|| self.periodic(now, source, outputs))
    }

    fn diagnostics(&mut self, now: Micros, source: u8, dtcs: &DtcList) -> Option<Frame> {
        // Both lists share one transport: they wait while it is busy.
        if self.broadcast.is_busy() {
            return None;
        }
        let has_active = dtcs.has_active();
        let is_due = now >= self.dm1_due;
        if is_due {
            self.dm1_due = later(now, &DM1);
        }
        if self.dm1_requested || is_due && (has_active || self.dm1_held) {
            self.dm1_requested = false;
            self.dm1_held = has_active;
            return self.send_list(now, source, &DM1, &diagnostic_messages::list(dtcs, DtcListKind::Active));
        }
        if core::mem::take(&mut self.dm2_requested) {
            return self.send_list(
                now,
                source,
                &DM2,
                &diagnostic_messages::list(dtcs, DtcListKind::Previous),
            );
        }
        None
    }

    /// Sends a list in one frame if it fits, else its announcement.
    fn send_list(&mut self, now: Micros, source: u8, message: &Message, bytes: &[u8]) -> Option<Frame> {
        match <[u8; 8]>::try_from(bytes) {
            Ok(data) => Some(frame_of(message, source, data)),
            Err(_) if self.broadcast.start(now, message.pgn, bytes) => self.broadcast.poll(now, source),
            Err(_) => None,
        }
    }

    fn periodic(&mut self, now: Micros, source: u8, outputs: &Outputs<'_>) -> Option<Frame> {
        for (message, due) in PERIODIC.iter().zip(&mut self.due) {
            if now < *due {
                continue;
            }
            // The schedule keeps its phase, unless it is so late that messages would follow one another without a
            // gap.
            let in_step = Micros(due.0.saturating_add(1000 * u64::from(message.period_ms)));
            *due = if in_step > now { in_step } else { later(now, message) };
            let data = if message.pgn == LEAKAGE.pgn {
                publish::leakage(outputs.estimate)
            } else if message.pgn == LEAKAGE_SE.pgn {
                publish::leakage_se(outputs.estimate)
            } else if message.pgn == EFFICIENCY.pgn {
                publish::efficiency(outputs.estimate)
            } else if message.pgn == VALIDITY.pgn {
                self.counter = self.counter.wrapping_add(1);
                publish::validity(outputs.estimate, self.counter)
            } else if message.pgn == STATUS.pgn {
                publish::status(outputs.calibration, outputs.health)
            } else if let Some(health) = outputs.health {
                publish::health(health)
            } else {
                continue;
            };
            return Some(frame_of(message, source, data));
        }
        None
    }
}

fn later(now: Micros, message: &Message) -> Micros {
    Micros(now.0.saturating_add(1000 * u64::from(message.period_ms)))
}

fn frame_of(message: &Message, source: u8, data: [u8; 8]) -> Frame {
    Frame::new(Id::new(message.priority, message.pgn, GLOBAL, source), data)
}
