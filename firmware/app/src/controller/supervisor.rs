//! Task `supervise`: feeds the watchdog while every task comes to its turns, and only then.
//!
//! A task is overdue when its turns have stood still for longer than it may be silent. The watchdog is then not fed any
//! more, for good: a task that comes back late has been dead, and what it left behind is not to be trusted. The hardware
//! resets, and the note of which task it was is in memory that survives the reset.

use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::{Duration, Instant};

use super::periodic::Ticker;
use super::periods::SUPERVISE_PERIOD;
use super::shared::Controller;
use super::task_stats::{AllTaskStats, TaskStats};
use crate::log::warning;

/// A watched task.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[allow(missing_docs, reason = "each variant is the task of its name")]
pub enum Task {
    Sample,
    Estimate,
    Publish,
    Store,
}

impl Task {
    /// Every watched task.
    pub const ALL: [Self; 4] = [Self::Sample, Self::Estimate, Self::Publish, Self::Store];

    /// Name as notes and logs state it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Sample => "sample",
            Self::Estimate => "estimate",
            Self::Publish => "publish",
            Self::Store => "store",
        }
    }

    /// Longest time without a turn.
    #[must_use]
    pub const fn timeout(self) -> Duration {
        match self {
            Self::Sample => Duration::from_millis(20),
            Self::Estimate => Duration::from_millis(100),
            Self::Publish => Duration::from_secs(1),
            Self::Store => Duration::from_secs(10),
        }
    }

    fn vital(self, vitals: &AllTaskStats) -> &TaskStats {
        match self {
            Self::Sample => &vitals.sample,
            Self::Estimate => &vitals.estimate,
            Self::Publish => &vitals.publish,
            Self::Store => &vitals.store,
        }
    }
}

/// The hardware that resets the controller when it is not fed, and the memory that tells afterwards.
pub trait Watchdog {
    /// Starts the hardware's time anew.
    fn feed(&mut self);

    /// Called once, when a task is overdue: leave a [crash record](crate::diagnostics::crash_log), the reset is near.
    fn give_up(&mut self, task: Task);
}

/// Which tasks have come to their turns.
#[derive(Debug, Clone)]
pub struct Supervisor {
    seen: [(u32, Instant); Task::ALL.len()],
    overdue: Option<Task>,
}

impl Supervisor {
    /// At the start of the tasks.
    #[must_use]
    pub const fn new(start: Instant) -> Self {
        Self { seen: [(0, start); Task::ALL.len()], overdue: None }
    }

    /// Looks at every task; the first one that is overdue, once found, for good.
    // Not inlined: the proof of the stacks knows the task by it.
    #[inline(never)]
    pub fn look(&mut self, vitals: &AllTaskStats, now: Instant) -> Option<Task> {
        for (task, (turns, since)) in Task::ALL.into_iter().zip(&mut self.seen) {
            let turns_now = task.vital(vitals).read().turns;
            if turns_now != *turns {
                (*turns, *since) = (turns_now, now);
            } else if now.saturating_duration_since(*since) > task.timeout() + SUPERVISE_PERIOD {
                self.overdue.get_or_insert(task);
            }
        }
        self.overdue
    }
}

/// Supervises for ever.
pub async fn run_supervise<M: RawMutex>(
    controller: &Controller<M>,
    start: Instant,
    watchdog: &mut impl Watchdog,
) -> ! {
    let mut pace = Ticker::new(start, SUPERVISE_PERIOD, &controller.vitals.supervise);
    let mut supervisor = Supervisor::new(start);
    let mut given_up = false;
    loop {
        let now = pace.turn().await;
        match supervisor.look(&controller.vitals, now) {
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
