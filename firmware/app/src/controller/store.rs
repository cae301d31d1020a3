//! Task `store`: what must outlast a power cut, to where it does.

use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::Instant;
use kou_estimator::Estimate;

use super::{Controller, NoEstimate, Pace, STORE_PERIOD, now};

/// Non-volatile memory, at the level of what is kept.
#[allow(async_fn_in_trait, reason = "called by tasks that are not sent between threads")]
pub trait Store {
    /// Keeps what of this is worth keeping; called once a second. Writing is the implementor's choice: flash wears.
    async fn keep(&mut self, estimate: &Result<Estimate, NoEstimate>);
}

/// Stores for ever.
pub async fn run_store<M: RawMutex>(controller: &Controller<M>, start: Instant, to: &mut impl Store) -> ! {
    let mut pace = Pace::new(start, STORE_PERIOD, &controller.vitals.store);
    loop {
        pace.turn().await;
        to.keep(&controller.output(now())).await;
    }
}
