//! The CAN bus around the controller: what others say on it, and what the controller says.

use kou_emulation::{CanFrame, MAX_CAN};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use serde::Serialize;

use super::scenario::{Babble, Scenario};

/// What was on the bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Traffic {
    /// Frames that the controller sent.
    pub sent: u64,
    /// Frames that others sent.
    pub others: u64,
    /// Time of the controller's first frame, ms.
    pub first_ms: Option<u64>,
    /// Longest time between two frames of the controller, ms.
    pub longest_silence_ms: u64,
}

/// The bus.
#[derive(Debug)]
pub struct Bus {
    rng: ChaCha8Rng,
    babble: Vec<Babble>,
    traffic: Traffic,
    ms: u64,
    last_ms: Option<u64>,
}

impl Bus {
    /// The bus of a scenario.
    #[must_use]
    pub fn new(scenario: &Scenario) -> Self {
        Self {
            // Another stream than the sensors', so that traffic does not change their noise.
            rng: ChaCha8Rng::seed_from_u64(!scenario.seed),
            babble: scenario.babble.clone(),
            traffic: Traffic::default(),
            ms: 0,
            last_ms: None,
        }
    }

    /// One millisecond: takes what the controller has sent, and gives what others send.
    pub fn millisecond(&mut self, time_s: f64, sent: &[CanFrame]) -> heapless::Vec<CanFrame, MAX_CAN> {
        self.ms += 1;
        if !sent.is_empty() {
            self.traffic.sent += sent.len() as u64;
            self.traffic.first_ms.get_or_insert(self.ms);
            if let Some(last) = self.last_ms {
                self.traffic.longest_silence_ms = self.traffic.longest_silence_ms.max(self.ms - last);
            }
            self.last_ms = Some(self.ms);
        }
        let mut frames = heapless::Vec::new();
        let babble = self.babble.iter().find(|babble| time_s >= babble.from_s && time_s < babble.until_s);
        let count = babble.map_or(0, |babble| babble.frames_per_ms.min(MAX_CAN as u32));
        for _ in 0..count {
            let id = self.rng.next_u32() & 0x1FFF_FFFF;
            // One in four is addressed to everybody as a request, a claim or a step of an update.
            let id = match self.rng.next_u32() % 16 {
                0 => id & 0x1C00_00FF | 0x00EA_FF00,
                1 => id & 0x1C00_00FF | 0x00EE_FF00,
                2 => id & 0x1C00_00FF | 0x00EF_8C00,
                3 => id & 0x1C00_00FF | 0x00EA_8C00,
                _ => id,
            };
            let mut data = heapless::Vec::new();
            let bytes = self.rng.next_u64().to_le_bytes();
            let length = (self.rng.next_u32() % 9) as usize;
            data.extend(bytes.into_iter().take(length));
            self.traffic.others += 1;
            // Counted to fit above.
            frames.push((id, data)).ok();
        }
        frames
    }

    /// What was on the bus so far.
    #[must_use]
    pub const fn traffic(&self) -> Traffic {
        self.traffic
    }
}
