//! Timing statistics of the tasks: cycles, missed deadlines, jitter and execution time.
//!
//! Each figure is written by one task only, so plain loads and stores suffice.

use core::sync::atomic::{AtomicU32, Ordering};

use embassy_time::Duration;
use serde::{Deserialize, Serialize};

/// Statistics of one task. Every figure saturates, except the cycle count, which wraps.
#[derive(Debug)]
pub struct TaskStats {
    cycles: AtomicU32,
    missed: AtomicU32,
    skipped: AtomicU32,
    max_jitter_us: AtomicU32,
    max_execution_us: AtomicU32,
}

/// Statistics of one task at one instant.
#[doc(alias = "jitter")]
#[doc(alias = "WCET")]
#[doc(alias = "execution time")]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TaskStatsSnapshot {
    /// Cycles begun since start, modulo 2^32.
    pub cycles: u32,
    /// Cycles that had not ended when the next one was due.
    pub missed: u32,
    /// Cycles skipped because an earlier one took too long.
    pub skipped: u32,
    /// Longest delay from the due time of a cycle to its start, us.
    pub max_jitter_us: u32,
    /// Longest execution time of a cycle including interruptions, us.
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

    /// Present values.
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

/// Statistics of all watched tasks and of the supervisor.
#[derive(Debug)]
#[allow(missing_docs, reason = "each field is the task of its name")]
pub struct AllTaskStats {
    pub sample: TaskStats,
    pub estimate: TaskStats,
    pub publish: TaskStats,
    pub storage: TaskStats,
    pub supervise: TaskStats,
}

impl AllTaskStats {
    pub(super) const fn new() -> Self {
        Self {
            sample: TaskStats::new(),
            estimate: TaskStats::new(),
            publish: TaskStats::new(),
            storage: TaskStats::new(),
            supervise: TaskStats::new(),
        }
    }

    /// Statistics of every task, in the order of the fields.
    #[must_use]
    pub fn read(&self) -> [TaskStatsSnapshot; 5] {
        [&self.sample, &self.estimate, &self.publish, &self.storage, &self.supervise].map(TaskStats::read)
    }
}
