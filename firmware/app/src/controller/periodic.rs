//! The pace of a periodic task: when its next turn is due, and what it costs.
//!
//! Turns are due at whole multiples of the period after the start, for ever: lateness of one does not move the next, so no
//! time leaks. A turn that is not done when the next one is due has missed its deadline; due times that have passed by
//! then are left out and counted, because catching up would only make the next one late as well.

use embassy_time::{Duration, Instant, Timer};

use super::vital::Vital;

/// Pace of one task.
#[derive(Debug)]
pub struct Pace<'a> {
    period: Duration,
    due: Instant,
    began: Option<Instant>,
    vital: &'a Vital,
}

impl<'a> Pace<'a> {
    /// The first turn is due one period after `start`. A period of zero is taken for the clock's shortest.
    #[must_use]
    pub fn new(start: Instant, period: Duration, vital: &'a Vital) -> Self {
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
