//! Ticker of a periodic task: due time of the next cycle, jitter and execution time.
//!
//! Cycles are due at whole multiples of the period after the start: a late cycle does not shift the next one, so the
//! schedule does not drift. A cycle that is still running when the next one is due has missed its deadline; due times
//! that have passed by then are skipped and counted, because catching up would only delay the following cycles.

use embassy_time::{Duration, Instant, Timer};
use kou_estimator::units::Micros;

use super::task_stats::TaskStats;

/// Ticker of one task.
#[derive(Debug)]
pub struct Ticker<'a> {
    period: Duration,
    due: Instant,
    began: Option<Instant>,
    stats: &'a TaskStats,
}

impl<'a> Ticker<'a> {
    /// Ticker whose first cycle is due one period after `start`. A period of zero is replaced by the clock's
    /// shortest.
    #[must_use]
    pub fn new(start: Instant, period: Duration, stats: &'a TaskStats) -> Self {
        let period = period.max(Duration::from_ticks(1));
        Self { period, due: start, began: None, stats }
    }

    /// Ends the present cycle and waits for the next.
    pub async fn cycle(&mut self) -> Instant {
        Timer::at(self.end_cycle()).await;
        self.begin_cycle()
    }

    /// Ends the present cycle and returns the due time of the next one, for a task with work to do until then.
    pub fn end_cycle(&mut self) -> Instant {
        let done = Instant::now();
        self.due = self.due.saturating_add(self.period);
        if let Some(began) = self.began {
            self.stats.record_execution(done.saturating_duration_since(began));
            if done > self.due {
                let behind = done.saturating_duration_since(self.due).as_ticks();
                let skipped = behind.div_ceil(self.period.as_ticks());
                self.stats.record_miss(skipped);
                let left_out = Duration::from_ticks(skipped.saturating_mul(self.period.as_ticks()));
                self.due = self.due.saturating_add(left_out);
            }
        }
        self.due
    }

    /// Begins the cycle that is due.
    pub fn begin_cycle(&mut self) -> Instant {
        let now = Instant::now();
        self.began = Some(now);
        self.stats.record_start(now.saturating_duration_since(self.due));
        now
    }
}

/// Time of the tasks' clock in the estimator's unit.
pub(super) fn now() -> Micros {
    Micros(embassy_time::Instant::now().as_micros())
}

#[cfg(test)]
mod tests {
    use core::future::Future;
    use core::pin::pin;
    use core::task::{Context, Waker};

    use embassy_time::MockDriver;

    use super::super::task_stats::AllTaskStats;
    use super::*;

    #[test]
    fn jitter_is_the_longest_wait_from_due_to_begun() {
        let task_stats = AllTaskStats::new();
        let clock = MockDriver::get();
        let mut ticker = Ticker::new(Instant::now(), Duration::from_millis(10), &task_stats.publish);
        for late_us in [0, 250, 40] {
            let mut cycle = pin!(ticker.cycle());
            let mut context = Context::from_waker(Waker::noop());
            assert!(cycle.as_mut().poll(&mut context).is_pending());
            let to_due = 10_000 - Instant::now().as_micros() % 10_000;
            clock.advance(Duration::from_micros(to_due + late_us));
            assert!(cycle.as_mut().poll(&mut context).is_ready());
        }
        assert_eq!(task_stats.publish.read().max_jitter_us, 250);
    }
}
