//! Task `publish`: reports estimates to a bus, a log or any other receiver.

use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::Instant;
use kou_estimator::units::{Celsius, Micros};
use kou_estimator::{Estimate, Reading, Sample};

use super::periodic::{Ticker, now};
use super::periods::PUBLISH_PERIOD;
use super::shared::{Controller, NoEstimate};

/// Receiver of estimates: a CAN bus, a log.
#[allow(async_fn_in_trait, reason = "called by tasks that are not sent between threads")]
pub trait Publish {
    /// Reports the estimate, or why there is none, and the sample if there is one. Must not wait longer than a
    /// period: the implementor drops and counts what the bus does not accept by then.
    async fn publish(
        &mut self,
        now: Micros,
        estimate: &Result<Estimate, NoEstimate>,
        sample: Option<&Sample>,
    );

    /// Oil temperature of an external sensor, as received by the implementor; not fitted by default.
    fn external_oil_temperature(&self, _now: Micros) -> Reading<Celsius> {
        Reading::not_fitted()
    }
}

/// Runs the publishing task; never returns.
pub async fn run_publish<M: RawMutex>(
    controller: &Controller<M>,
    start: Instant,
    to: &mut impl Publish,
) -> ! {
    let mut ticker = Ticker::new(start, PUBLISH_PERIOD, &controller.task_stats.publish);
    loop {
        ticker.cycle().await;
        let now = now();
        let estimate = controller.output(now);
        to.publish(now, &estimate, controller.sample().as_ref()).await;
        controller.set_external_oil_temperature(to.external_oil_temperature(now));
    }
}
