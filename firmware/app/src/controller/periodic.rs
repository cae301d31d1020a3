//! The pace of a periodic task: when its next turn is due, and what it costs.
//!
//! Turns are due at whole multiples of the period after the start, for ever: lateness of one does not move the next, so no
//! time leaks. A turn that is not done when the next one is due has missed its deadline; due times that have passed by
//! then are left out and counted, because catching up would only make the next one late as well.

use embassy_time::{Duration, Instant, Timer};
use kou_estimator::units::Micros;

use super::task_stats::TaskStats;

/// Pace of one task.
#[derive(Debug)]
pub struct Ticker<'a> {
    period: Duration,
    due: Instant,
    began: Option<Instant>,
    vital: &'a TaskStats,
}

impl<'a> Ticker<'a> {
    /// The first turn is due one period after `start`. A period of zero is taken for the clock's shortest.
    #[must_use]
    pub fn new(start: Instant, period: Duration, vital: &'a TaskStats) -> Self {
        let period = period.max(Duration::from_ticks(1));
        Self { period, due: start, began: None, vital }
    }

    /// Ends the present turn and waits for the next.
    pub async fn turn(&mut self) -> Instant {
        Timer::at(self.end()).await;
        self.begin()
    }

    /// Ends the present turn and says when the next one is due, for a task that has something to do until then.
    pub fn end(&mut self) -> Instant {
        let done = Instant::now();
        self.due = self.due.saturating_add(self.period);
        if let Some(began) = self.began {
            self.vital.took(done.saturating_duration_since(began));
            if done > self.due {
                let behind = done.saturating_duration_since(self.due).as_ticks();
                let skipped = behind.div_ceil(self.period.as_ticks());
                self.vital.misses(skipped);
                let left_out = Duration::from_ticks(skipped.saturating_mul(self.period.as_ticks()));
                self.due = self.due.saturating_add(left_out);
            }
        }
        self.due
    }

    /// Begins the turn that is due.
    pub fn begin(&mut self) -> Instant {
        let now = Instant::now();
        self.began = Some(now);
        self.vital.begins(now.saturating_duration_since(self.due));
        now
    }
}

/// The clock of the tasks as the estimator states time.
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
        let vitals = AllTaskStats::new();
        let clock = MockDriver::get();
        let mut pace = Ticker::new(Instant::now(), Duration::from_millis(10), &vitals.publish);
        for late_us in [0, 250, 40] {
            let mut turn = pin!(pace.turn());
            let mut context = Context::from_waker(Waker::noop());
            assert!(turn.as_mut().poll(&mut context).is_pending());
            let to_due = 10_000 - Instant::now().as_micros() % 10_000;
            clock.advance(Duration::from_micros(to_due + late_us));
            assert!(turn.as_mut().poll(&mut context).is_ready());
        }
        assert_eq!(vitals.publish.read().latest_us, 250);
    }
}
