//! Event counters, written by one task each and readable by all.
//!
//! A single writer per counter makes plain loads and stores sufficient: no lock, and no lost count.

use core::sync::atomic::{AtomicU32, Ordering};

use crate::link::{FrameError, LinkCounts};

/// Saturating counter.
#[derive(Debug)]
pub struct Counter(AtomicU32);

impl Counter {
    const fn new() -> Self {
        Self(AtomicU32::new(0))
    }

    /// Increments the counter. To be called from one task only.
    pub fn increment(&self) {
        self.0.store(self.get().saturating_add(1), Ordering::Relaxed);
    }

    /// Present count.
    #[must_use]
    pub fn get(&self) -> u32 {
        self.0.load(Ordering::Relaxed)
    }
}

/// Event counters; [`LinkCounts`] describes each of them.
#[derive(Debug)]
#[allow(missing_docs, reason = "the fields are those of `LinkCounts`, described there")]
pub struct Counters {
    pub frames_ok: Counter,
    pub frames_too_long: Counter,
    pub frames_too_short: Counter,
    pub frames_cobs: Counter,
    pub frames_crc: Counter,
    pub frames_unknown: Counter,
    pub frames_payload: Counter,
    pub samples: Counter,
    pub samples_without_calibration: Counter,
    pub estimates_valid: Counter,
    pub estimates_rejected: Counter,
    pub calibrations_accepted: Counter,
    pub calibrations_rejected: Counter,
    pub heartbeats: Counter,
}

impl Counters {
    /// All counters zero.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            frames_ok: Counter::new(),
            frames_too_long: Counter::new(),
            frames_too_short: Counter::new(),
            frames_cobs: Counter::new(),
            frames_crc: Counter::new(),
            frames_unknown: Counter::new(),
            frames_payload: Counter::new(),
            samples: Counter::new(),
            samples_without_calibration: Counter::new(),
            estimates_valid: Counter::new(),
            estimates_rejected: Counter::new(),
            calibrations_accepted: Counter::new(),
            calibrations_rejected: Counter::new(),
            heartbeats: Counter::new(),
        }
    }

    /// Counter of frames rejected for this reason.
    #[must_use]
    pub const fn of_error(&self, error: FrameError) -> &Counter {
        match error {
            FrameError::TooLong => &self.frames_too_long,
            FrameError::TooShort => &self.frames_too_short,
            FrameError::Cobs => &self.frames_cobs,
            FrameError::Crc => &self.frames_crc,
            FrameError::Unknown => &self.frames_unknown,
            FrameError::Payload => &self.frames_payload,
        }
    }

    /// Present counts.
    #[must_use]
    pub fn read(&self) -> LinkCounts {
        LinkCounts {
            frames_ok: self.frames_ok.get(),
            frames_too_long: self.frames_too_long.get(),
            frames_too_short: self.frames_too_short.get(),
            frames_cobs: self.frames_cobs.get(),
            frames_crc: self.frames_crc.get(),
            frames_unknown: self.frames_unknown.get(),
            frames_payload: self.frames_payload.get(),
            samples: self.samples.get(),
            samples_without_calibration: self.samples_without_calibration.get(),
            estimates_valid: self.estimates_valid.get(),
            estimates_rejected: self.estimates_rejected.get(),
            calibrations_accepted: self.calibrations_accepted.get(),
            calibrations_rejected: self.calibrations_rejected.get(),
            heartbeats: self.heartbeats.get(),
        }
    }
}

impl Default for Counters {
    fn default() -> Self {
        Self::new()
    }
}
