//! Transport protocol for broadcast messages of more than eight bytes: announcement (BAM) and packets (SAE J1939-21).
//!
//! One message at a time, 50 ms between packets. There is no receiver: no message that the controller accepts is that
//! long, and a calibration has its own transfer (`crate::update`).

use heapless::Vec;
use kou_estimator::units::Micros;

use super::catalogue::{TP_CM, TP_CONTROL, TP_DT, TP_PACKETS, TP_PGN, TP_SEQUENCE, TP_SIZE};
use super::id::{Frame, GLOBAL, Id, Pgn};

/// Longest message: a list of [`crate::diagnostics::CAPACITY`] trouble codes.
pub const MAX_LEN: usize = 2 + 4 * crate::diagnostics::CAPACITY;
/// Payload of a packet in bytes.
const PACKET: usize = 7;
/// Time between packets: the standard allows 50 to 200 ms.
const SPACING_US: u64 = 50_000;
/// Control byte of a broadcast announcement.
const BAM: u32 = 32;

/// Broadcast of one message.
#[doc(alias = "BAM")]
#[doc(alias = "transport protocol")]
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Broadcast {
    pgn: Pgn,
    bytes: Vec<u8, MAX_LEN>,
    /// Number of the next packet; 0 is the announcement.
    next: u8,
    due: Micros,
}

impl Default for Broadcast {
    fn default() -> Self {
        Self::new()
    }
}

impl Broadcast {
    /// No message in progress.
    #[must_use]
    pub const fn new() -> Self {
        Self { pgn: Pgn::new(0), bytes: Vec::new(), next: 0, due: Micros(0) }
    }

    /// Whether a message is in progress.
    #[must_use]
    pub fn is_busy(&self) -> bool {
        !self.bytes.is_empty()
    }

    /// Starts a message of more than eight bytes; a shorter one is sent in one frame.
    ///
    /// # Errors
    /// Returns false when another message is in progress or the message is too long; nothing changes then.
    #[must_use]
    pub fn start(&mut self, now: Micros, pgn: Pgn, bytes: &[u8]) -> bool {
        if self.is_busy() || self.bytes.extend_from_slice(bytes).is_err() {
            return false;
        }
        self.pgn = pgn;
        self.next = 0;
        self.due = now;
        true
    }

    /// Discards the message in progress, as when the address is lost.
    pub fn stop(&mut self) {
        self.bytes.clear();
    }

    /// Next frame that is due.
    pub fn poll(&mut self, now: Micros, source: u8) -> Option<Frame> {
        if !self.is_busy() || now < self.due {
            return None;
        }
        self.due = Micros(now.0.saturating_add(SPACING_US));
        let mut data = [0xFF; 8];
        if self.next == 0 {
            self.next = 1;
            let packets = self.bytes.len().div_ceil(PACKET);
            TP_CONTROL.put_raw(&mut data, BAM);
            TP_SIZE.put_raw(&mut data, self.bytes.len() as u32);
            TP_PACKETS.put_raw(&mut data, packets as u32);
            TP_PGN.put_raw(&mut data, self.pgn.get());
            return Some(Frame::new(Id::new(TP_CM.priority, TP_CM.pgn, GLOBAL, source), data));
        }
        let packet = usize::from(self.next).saturating_sub(1);
        let mut packets = self.bytes.chunks(PACKET);
        let bytes = packets.nth(packet)?;
        let is_last = packets.next().is_none();
        let [_, rest @ ..] = &mut data;
        for (slot, byte) in rest.iter_mut().zip(bytes) {
            *slot = *byte;
        }
        TP_SEQUENCE.put_raw(&mut data, u32::from(self.next));
        self.next = self.next.saturating_add(1);
        if is_last {
            self.bytes.clear();
        }
        Some(Frame::new(Id::new(TP_DT.priority, TP_DT.pgn, GLOBAL, source), data))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn message_arrives_complete_in_spaced_packets() {
        for len in 9..=MAX_LEN {
            let bytes: std::vec::Vec<u8> = (0..len as u8).collect();
            let mut broadcast = Broadcast::new();
            assert!(broadcast.start(Micros(0), Pgn::new(65226), &bytes));
            assert!(!broadcast.start(Micros(0), Pgn::new(65227), &bytes), "one at a time");
            let mut got = std::vec::Vec::new();
            let announced = broadcast.poll(Micros(0), 0x27).unwrap();
            assert_eq!(announced.id().raw(), 0x1CEC_FF27);
            let packets = len.div_ceil(7) as u8;
            assert_eq!(announced.data(), [32, len as u8, 0, packets, 0xFF, 0xCA, 0xFE, 0]);
            let mut now = 0;
            for number in 1..=packets {
                assert!(broadcast.poll(Micros(now + 49_999), 0x27).is_none());
                now += 50_000;
                let frame = broadcast.poll(Micros(now), 0x27).unwrap();
                assert_eq!((frame.id().raw(), frame.data()[0]), (0x1CEB_FF27, number));
                got.extend_from_slice(&frame.data()[1..]);
            }
            assert!(!broadcast.is_busy());
            assert_eq!(got[..len], bytes);
            assert!(got[len..].iter().all(|byte| *byte == 0xFF));
        }
    }

    #[test]
    fn message_that_is_too_long_is_rejected() {
        let mut broadcast = Broadcast::new();
        assert!(!broadcast.start(Micros(0), Pgn::new(65226), &[0; MAX_LEN + 1]));
        assert!(!broadcast.is_busy());
    }
}
