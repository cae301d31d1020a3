//! How a task is doing: turns, deadlines, lateness, time taken.
//!
//! Each figure has one task that writes it, so plain loads and stores suffice.

use core::sync::atomic::{AtomicU32, Ordering};

use embassy_time::Duration;
use serde::{Deserialize, Serialize};

/// One task's figures; each stays at its maximum instead of wrapping, but for the turns, which wrap.
#[derive(Debug)]
pub struct Vital {
    turns: AtomicU32,
    missed: AtomicU32,
    skipped: AtomicU32,
    latest_us: AtomicU32,
    longest_us: AtomicU32,
}

/// One task's figures at one time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct VitalsRead {
    /// Turns begun since start, modulo 2^32.
    pub turns: u32,
    /// Turns that were not done when the next one was due.
    pub missed: u32,
    /// Turns that were left out because an earlier one took so long.
    pub skipped: u32,
    /// Longest time from when a turn was due to its beginning, us: the jitter.
    pub latest_us: u32,
    /// Longest turn, us, with what interrupted it.
    pub longest_us: u32,
}

impl Vital {
    const fn new() -> Self {
        Self {
            turns: AtomicU32::new(0),
            missed: AtomicU32::new(0),
            skipped: AtomicU32::new(0),
            latest_us: AtomicU32::new(0),
            longest_us: AtomicU32::new(0),
        }
    }

    /// The figures as they stand.
    #[must_use]
    pub fn read(&self) -> VitalsRead {
        VitalsRead {
            turns: self.turns.load(Ordering::Relaxed),
            missed: self.missed.load(Ordering::Relaxed),
            skipped: self.skipped.load(Ordering::Relaxed),
            latest_us: self.latest_us.load(Ordering::Relaxed),
            longest_us: self.longest_us.load(Ordering::Relaxed),
        }
    }

    pub(super) fn begins(&self, late: Duration) {
        self.turns.store(self.turns.load(Ordering::Relaxed).wrapping_add(1), Ordering::Relaxed);
        raise(&self.latest_us, late);
    }

    pub(super) fn took(&self, time: Duration) {
        raise(&self.longest_us, time);
    }

    pub(super) fn misses(&self, skipped: u64) {
        add(&self.missed, 1);
        add(&self.skipped, skipped);
    }
}

fn raise(figure: &AtomicU32, time: Duration) {
    let us = u32::try_from(time.as_micros()).unwrap_or(u32::MAX);
    figure.store(figure.load(Ordering::Relaxed).max(us), Ordering::Relaxed);
}

fn add(figure: &AtomicU32, more: u64) {
    let more = u32::try_from(more).unwrap_or(u32::MAX);
    figure.store(figure.load(Ordering::Relaxed).saturating_add(more), Ordering::Relaxed);
}

/// Figures of all tasks that the supervisor watches, and of itself.
#[derive(Debug)]
#[allow(missing_docs, reason = "each field is the task of its name")]
pub struct Vitals {
    pub sample: Vital,
    pub estimate: Vital,
    pub publish: Vital,
    pub store: Vital,
    pub supervise: Vital,
}

impl Vitals {
    pub(super) const fn new() -> Self {
        Self {
            sample: Vital::new(),
            estimate: Vital::new(),
            publish: Vital::new(),
            store: Vital::new(),
            supervise: Vital::new(),
        }
    }

    /// Every task's figures, in the order of the fields.
    #[must_use]
    pub fn read(&self) -> [VitalsRead; 5] {
        [&self.sample, &self.estimate, &self.publish, &self.store, &self.supervise].map(Vital::read)
    }
}
