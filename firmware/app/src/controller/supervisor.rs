//! Task `supervise`: feeds the watchdog while every task completes its cycles, and only then.
//!
//! A task is overdue when its cycle count has not changed for longer than its timeout. From then on the watchdog is
//! never fed again: the state left by a stalled task is not trustworthy even if it resumes. The hardware resets, and
//! a crash record that names the task survives the reset.

use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::{Duration, Instant};

use super::periodic::Ticker;
use super::periods::SUPERVISE_PERIOD;
use super::shared::Controller;
use super::task_stats::{AllTaskStats, TaskStats};
use crate::log::warning;

/// Watched task.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[allow(missing_docs, reason = "each variant is the task of its name")]
pub enum Task {
    Sample,
    Estimate,
    Publish,
    Storage,
}

impl Task {
    /// Every watched task.
    pub const ALL: [Self; 4] = [Self::Sample, Self::Estimate, Self::Publish, Self::Storage];

    /// Name in crash records and logs.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Sample => "sample",
            Self::Estimate => "estimate",
            Self::Publish => "publish",
            Self::Storage => "storage",
        }
    }

    /// Longest time without a cycle.
    #[must_use]
    pub const fn timeout(self) -> Duration {
        match self {
            Self::Sample => Duration::from_millis(20),
            Self::Estimate => Duration::from_millis(100),
            Self::Publish => Duration::from_secs(1),
            Self::Storage => Duration::from_secs(10),
        }
    }

    fn stats(self, task_stats: &AllTaskStats) -> &TaskStats {
        match self {
            Self::Sample => &task_stats.sample,
            Self::Estimate => &task_stats.estimate,
            Self::Publish => &task_stats.publish,
            Self::Storage => &task_stats.storage,
        }
    }
}

/// Watchdog hardware, and the memory for its crash record.
pub trait Watchdog {
    /// Restarts the watchdog's period.
    fn feed(&mut self);

    /// Called once, when a task is overdue: writes a [crash record](crate::diagnostics::crash_log) before the reset.
    fn give_up(&mut self, task: Task);
}

/// Supervisor of the tasks' cycle counts.
#[derive(Debug, Clone)]
pub struct Supervisor {
    observed: [(u32, Instant); Task::ALL.len()],
    overdue: Option<Task>,
}

impl Supervisor {
    /// At the start of the tasks.
    #[must_use]
    pub const fn new(start: Instant) -> Self {
        Self { observed: [(0, start); Task::ALL.len()], overdue: None }
    }

    /// Checks every task; returns the first overdue one, permanently once found.
    // Not inlined: the stack analysis identifies the task by this function.
    #[inline(never)]
    pub fn check(&mut self, task_stats: &AllTaskStats, now: Instant) -> Option<Task> {
        for (task, (cycles, since)) in Task::ALL.into_iter().zip(&mut self.observed) {
            let cycles_now = task.stats(task_stats).read().cycles;
            if cycles_now != *cycles {
                (*cycles, *since) = (cycles_now, now);
            } else if now.saturating_duration_since(*since) > task.timeout() + SUPERVISE_PERIOD {
                self.overdue.get_or_insert(task);
            }
        }
        self.overdue
    }
}

/// Runs the supervising task; never returns.
pub async fn run_supervise<M: RawMutex>(
    controller: &Controller<M>,
    start: Instant,
    watchdog: &mut impl Watchdog,
) -> ! {
    let mut ticker = Ticker::new(start, SUPERVISE_PERIOD, &controller.task_stats.supervise);
    let mut supervisor = Supervisor::new(start);
    let mut given_up = false;
    loop {
        let now = ticker.cycle().await;
        match supervisor.check(&controller.task_stats, now) {
            None => watchdog.feed(),
            Some(task) if !given_up => {
                warning!("task {} is overdue: the watchdog starves", task.name());
                watchdog.give_up(task);
                given_up = true;
            }
            Some(_) => {}
        }
    }
}
