//! Address claim (SAE J1939-81): state machine that acquires, defends and loses the source address.
//!
//! ```text
//! new --claim sent--> contending --250 ms unopposed--> claimed
//!                        |  ^                             |
//!      lower NAME claims |  | next free address           | lower NAME claims
//!                        v  |                             |
//!                     (lost) <----------------------------+
//!                        | no address left, or not allowed another
//!                        v
//!                     silent: "cannot claim" from the null address, nothing else
//! ```
//!
//! A commanded address (PGN 65240) is ignored. As on every J1939 network, any node can take the address by claiming
//! it with a smaller NAME; that is reported as a fault and has no other effect.

use kou_estimator::units::Micros;

use super::catalogue::ADDRESS_CLAIMED;
use super::id::{Frame, GLOBAL, Id, NULL_ADDRESS};
use super::name::Name;
use crate::log::{info, warning};

/// Time for which a claim must stand unopposed.
const CONTENTION_US: u64 = 250_000;
/// First address of the arbitrary range.
const FIRST_ARBITRARY: u8 = 128;
/// Last address of the arbitrary range.
const LAST_ARBITRARY: u8 = 247;
/// Step of the delay before "cannot claim", so that several failed controllers do not answer at once.
const CANNOT_CLAIM_STEP_US: u64 = 600;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum ClaimState {
    /// No claim sent yet.
    New,
    /// Claim sent at this time and unopposed so far.
    Contending(Micros),
    Claimed,
    Silent,
}

/// Address claim of one controller: [`receive`](Self::receive) takes the claims of other nodes, [`poll`](Self::poll)
/// returns the frames to send.
#[doc(alias = "J1939-81")]
#[derive(Debug, Clone)]
pub struct AddressClaim {
    name: Name,
    preferred: u8,
    address: u8,
    stage: ClaimState,
    /// Time of the next claim to send.
    due: Option<Micros>,
    /// Addresses from [`FIRST_ARBITRARY`] on that other nodes have claimed, one bit each.
    taken: u128,
}

impl AddressClaim {
    /// State machine that claims `preferred` (0 to 253) at the first [`poll`](Self::poll).
    #[must_use]
    pub const fn new(name: Name, preferred: u8) -> Self {
        Self { name, preferred, address: preferred, stage: ClaimState::New, due: Some(Micros(0)), taken: 0 }
    }

    /// Address once claimed. Without one, nothing but address claims may be sent.
    #[must_use]
    pub fn address(&self) -> Option<u8> {
        (self.stage == ClaimState::Claimed).then_some(self.address)
    }

    /// Whether every address was lost, which is a fault to report.
    #[must_use]
    pub fn is_silent(&self) -> bool {
        self.stage == ClaimState::Silent
    }

    /// Restarts with the preferred address, as after bus-off.
    pub fn restart(&mut self) {
        *self = Self::new(self.name, self.preferred);
    }

    /// Processes the address claim of another node.
    pub fn receive(&mut self, now: Micros, source: u8, name: Name) {
        self.mark_taken(source);
        let holds = matches!(self.stage, ClaimState::Contending(_) | ClaimState::Claimed);
        // The same NAME is an echo of the own claim. Two controllers with one NAME are an assembly error that
        // claiming cannot resolve.
        if !holds || source != self.address || name == self.name {
            return;
        }
        if self.name < name {
            // Defend the address.
            self.due = Some(now);
            return;
        }
        warning!("address {=u8} lost to a smaller NAME", self.address);
        match self.next_free() {
            Some(address) if self.name.has_arbitrary_address() => {
                self.address = address;
                self.stage = ClaimState::New;
                self.due = Some(now);
            }
            _ => {
                self.stage = ClaimState::Silent;
                self.due = Some(self.cannot_claim_at(now));
            }
        }
    }

    /// Processes a request for the address, sent to all nodes or to this controller.
    pub fn on_request(&mut self, now: Micros) {
        self.due = match self.stage {
            // The first claim is about to be sent anyway.
            ClaimState::New => self.due,
            ClaimState::Silent => self.due.or(Some(self.cannot_claim_at(now))),
            ClaimState::Contending(_) | ClaimState::Claimed => Some(now),
        };
    }

    /// Next frame to send. To be called about every 10 ms.
    pub fn poll(&mut self, now: Micros) -> Option<Frame> {
        if let ClaimState::Contending(since) = self.stage
            && now.0.saturating_sub(since.0) >= CONTENTION_US
        {
            self.stage = ClaimState::Claimed;
            info!("address {=u8} claimed", self.address);
        }
        let due = self.due?;
        if now < due {
            return None;
        }
        self.due = None;
        if self.stage == ClaimState::New {
            self.stage = ClaimState::Contending(now);
        }
        let source = if self.stage == ClaimState::Silent { NULL_ADDRESS } else { self.address };
        let id = Id::new(ADDRESS_CLAIMED.priority, ADDRESS_CLAIMED.pgn, GLOBAL, source);
        Some(Frame::new(id, self.name.to_bytes()))
    }

    fn cannot_claim_at(&self, now: Micros) -> Micros {
        Micros(now.0.saturating_add(CANNOT_CLAIM_STEP_US * u64::from(self.name.spread())))
    }

    fn mark_taken(&mut self, source: u8) {
        if (FIRST_ARBITRARY..=LAST_ARBITRARY).contains(&source) {
            self.taken |= 1_u128.wrapping_shl(u32::from(source) - u32::from(FIRST_ARBITRARY));
        }
    }

    fn next_free(&self) -> Option<u8> {
        (FIRST_ARBITRARY..=LAST_ARBITRARY).find(|address| {
            let bit = u32::from(*address) - u32::from(FIRST_ARBITRARY);
            *address != self.address && self.taken.wrapping_shr(bit) & 1 == 0
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::name::NameConfig;
    use super::*;

    fn name(identity: u32, arbitrary_address: bool) -> Name {
        Name::new(&NameConfig { arbitrary_address, ..NameConfig::transmission(identity) }).unwrap()
    }

    fn ms(ms: u64) -> Micros {
        Micros(1000 * ms)
    }

    #[test]
    fn name_refuses_a_field_with_too_many_bits_and_packs_the_rest() {
        let good = NameConfig::transmission(0x1F_FFFF);
        assert!(Name::new(&good).is_ok());
        let wrong = NameConfig { identity: 0x20_0000, ..good };
        assert_eq!(Name::new(&wrong).unwrap_err().field, "identity");
        let wrong = NameConfig { vehicle_system: 0x80, ..good };
        assert_eq!(Name::new(&wrong).unwrap_err().field, "vehicle_system");
        let bytes = name(0x12345, true).to_bytes();
        assert_eq!(bytes, [0x45, 0x23, 0xE1, 0xFF, 0x01, 0x03, 0x00, 0x80]);
    }

    #[test]
    fn unopposed_claim_holds_after_250_ms_and_not_before() {
        let mut claim = AddressClaim::new(name(1, true), 0x27);
        let frame = claim.poll(ms(0)).unwrap();
        assert_eq!(frame.id().raw(), 0x18EE_FF27);
        assert_eq!(claim.address(), None);
        assert!(claim.poll(ms(249)).is_none());
        assert_eq!(claim.address(), None);
        assert!(claim.poll(ms(250)).is_none());
        assert_eq!(claim.address(), Some(0x27));
    }

    #[test]
    fn larger_name_is_defended_against_and_smaller_one_takes_the_address() {
        let mut claim = AddressClaim::new(name(5, true), 0x27);
        let _ = claim.poll(ms(0));
        let _ = claim.poll(ms(300));
        claim.receive(ms(301), 0x27, name(6, true));
        assert_eq!(claim.poll(ms(301)).unwrap().id().source(), 0x27);
        assert_eq!(claim.address(), Some(0x27), "defended");
        claim.receive(ms(310), 128, name(9, true));
        claim.receive(ms(320), 0x27, name(4, true));
        assert_eq!(claim.address(), None);
        // 128 is claimed by another node.
        assert_eq!(claim.poll(ms(320)).unwrap().id().source(), 129);
        let _ = claim.poll(ms(580));
        assert_eq!(claim.address(), Some(129));
    }

    #[test]
    fn without_an_address_left_it_sends_cannot_claim_once_and_is_silent() {
        for arbitrary in [false, true] {
            let mut claim = AddressClaim::new(name(7, arbitrary), 0x27);
            let _ = claim.poll(ms(0));
            for address in 128..=247 {
                claim.receive(ms(1), address, name(1, true));
            }
            claim.receive(ms(2), 0x27, name(1, arbitrary));
            assert!(claim.is_silent());
            assert!(claim.poll(ms(2)).is_none(), "delayed by 7 * 0.6 ms");
            assert_eq!(claim.poll(ms(7)).unwrap().id().raw(), 0x18EE_FFFE);
            assert!(claim.poll(ms(1000)).is_none());
            claim.on_request(ms(2000));
            assert_eq!(claim.poll(ms(2010)).unwrap().id().source(), NULL_ADDRESS);
            assert_eq!(claim.address(), None);
        }
    }

    #[test]
    fn request_is_answered_and_echo_is_not() {
        let mut claim = AddressClaim::new(name(7, true), 0x27);
        let _ = claim.poll(ms(0));
        let _ = claim.poll(ms(300));
        claim.receive(ms(301), 0x27, name(7, true));
        assert!(claim.poll(ms(301)).is_none());
        claim.on_request(ms(302));
        assert_eq!(claim.poll(ms(302)).unwrap().id().source(), 0x27);
    }
}
