//! How a task is doing: cycles, deadlines, lateness, time taken.
//!
//! Each figure has one task that writes it, so plain loads and stores suffice.

use core::sync::atomic::{AtomicU32, Ordering};

use embassy_time::Duration;
use serde::{Deserialize, Serialize};

/// One task's figures; each stays at its maximum instead of wrapping, but for the cycles, which wrap.
#[derive(Debug)]
pub struct TaskStats {
    cycles: AtomicU32,
    missed: AtomicU32,
    skipped: AtomicU32,
    max_jitter_us: AtomicU32,
    max_execution_us: AtomicU32,
}

/// One task's figures at one time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TaskStatsSnapshot {
    /// Turns begun since start, modulo 2^32.
    pub cycles: u32,
    /// Turns that were not done when the next one was due.
    pub missed: u32,
    /// Turns that were left out because an earlier one took so long.
    pub skipped: u32,
    /// Longest time from when a turn was due to its beginning, us: the jitter.
    pub max_jitter_us: u32,
    /// Longest turn, us, with what interrupted it.
    pub max_execution_us: u32,
}

impl TaskStats {
    const fn new() -> Self {
        Self {
            cycles: AtomicU32::new(0),
            missed: AtomicU32::new(0),
            skipped: AtomicU32::new(0),
            max_jitter_us: AtomicU32::new(0),
            max_execution_us: AtomicU32::new(0),
        }
    }

    /// The figures as they stand.
    #[must_use]
    pub fn read(&self) -> TaskStatsSnapshot {
        TaskStatsSnapshot {
            cycles: self.cycles.load(Ordering::Relaxed),
            missed: self.missed.load(Ordering::Relaxed),
            skipped: self.skipped.load(Ordering::Relaxed),
            max_jitter_us: self.max_jitter_us.load(Ordering::Relaxed),
            max_execution_us: self.max_execution_us.load(Ordering::Relaxed),
        }
    }

    pub(super) fn record_start(&self, late: Duration) {
        self.cycles.store(self.cycles.load(Ordering::Relaxed).wrapping_add(1), Ordering::Relaxed);
        raise(&self.max_jitter_us, late);
    }

    pub(super) fn record_execution(&self, time: Duration) {
        raise(&self.max_execution_us, time);
    }

    pub(super) fn record_miss(&self, skipped: u64) {
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
pub struct AllTaskStats {
    pub sample: TaskStats,
    pub estimate: TaskStats,
    pub publish: TaskStats,
    pub store: TaskStats,
    pub supervise: TaskStats,
}

impl AllTaskStats {
    pub(super) const fn new() -> Self {
        Self {
            sample: TaskStats::new(),
            estimate: TaskStats::new(),
            publish: TaskStats::new(),
            store: TaskStats::new(),
            supervise: TaskStats::new(),
        }
    }

    /// Every task's figures, in the order of the fields.
    #[must_use]
    pub fn read(&self) -> [TaskStatsSnapshot; 5] {
        [&self.sample, &self.estimate, &self.publish, &self.store, &self.supervise].map(TaskStats::read)
    }
}
