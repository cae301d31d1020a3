//! Task `estimate`: passes the latest sample to the estimator. The only task that owns parameters and state.

use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::Instant;
use kou_estimator::step;

use super::handover::Estimator;
use super::periodic::{Ticker, now};
use super::periods::ESTIMATE_PERIOD;
use super::shared::{Controller, NoEstimate};
use crate::log::info;

/// Runs the estimating task; never returns. Without parameters it waits for the first ones.
pub async fn run_estimate<M: RawMutex>(
    controller: &Controller<M>,
    start: Instant,
    estimator: &mut Estimator,
) -> ! {
    let mut ticker = Ticker::new(start, ESTIMATE_PERIOD, &controller.task_stats.estimate);
    loop {
        ticker.cycle().await;
        if controller.handover.serve(estimator) {
            controller.set_calibration(estimator.calibration);
            info!("calibration in use: {}", estimator.calibration);
        }
        cycle(controller, estimator);
    }
}

// Not inlined: an estimate and a sample would otherwise occupy the task's memory permanently.
#[inline(never)]
fn cycle<M: RawMutex>(controller: &Controller<M>, estimator: &mut Estimator) {
    let estimate = match (&estimator.params, controller.sample()) {
        (None, _) if controller.calibration().is_none() => Err(NoEstimate::Starting),
        (None, _) => Err(NoEstimate::NoCalibration),
        (_, None) => Err(NoEstimate::Starting),
        (Some(params), Some(mut sample)) => {
            // Stamped with the present time: when `sample` has stopped, its readings become stale.
            sample.time = now();
            let Estimator { state, consistency, .. } = estimator;
            let estimate = step(params, state, &sample);
            Ok(consistency.apply(state.health().last_change(), estimate))
        }
    };
    controller.set_estimate(now(), estimate);
}
