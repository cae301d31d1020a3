//! Count of requests that were received and not yet answered on the line.
//!
//! A line whose read blocks the whole processor (semihosting) must not be read while an answer is pending: host and
//! processor would wait for each other. Such a line awaits [`InFlight::wait_idle`] first.

use core::sync::atomic::{AtomicU32, Ordering};

use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_sync::signal::Signal;

/// Counter of unanswered requests. All its users run in one executor.
pub struct InFlight<M: RawMutex> {
    count: AtomicU32,
    emptied: Signal<M, ()>,
}

impl<M: RawMutex> InFlight<M> {
    pub(super) const fn new() -> Self {
        Self { count: AtomicU32::new(0), emptied: Signal::new() }
    }

    /// Counts a received request.
    pub(super) fn begin(&self) {
        self.count.fetch_add(1, Ordering::Relaxed);
    }

    /// Counts `answered` responses sent on the line.
    pub(super) fn complete(&self, answered: u32) {
        if self.count.fetch_sub(answered, Ordering::Relaxed) == answered {
            self.emptied.signal(());
        }
    }

    /// Waits until every request has been answered on the line. Only one task may wait.
    pub async fn wait_idle(&self) {
        // The signal may be left over from an earlier time, so the count decides.
        while self.count.load(Ordering::Relaxed) != 0 {
            self.emptied.wait().await;
        }
    }
}
