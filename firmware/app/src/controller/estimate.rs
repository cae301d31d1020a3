//! Task `estimate`: the latest sample through the estimator. The only task that holds parameters and state.

use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::Instant;
use kou_estimator::step;

use super::handover::Estimator;
use super::periodic::{Ticker, now};
use super::periods::ESTIMATE_PERIOD;
use super::shared::{Controller, NoEstimate};
use crate::log::info;

/// Estimates for ever. Without parameters it waits for the first ones.
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

// Not inlined: an estimate and a sample would lie in the task's memory for good.
#[inline(never)]
fn cycle<M: RawMutex>(controller: &Controller<M>, estimator: &mut Estimator) {
    let estimate = match (&estimator.params, controller.sample()) {
        (None, _) if controller.calibration().is_none() => Err(NoEstimate::Starting),
        (None, _) => Err(NoEstimate::NoCalibration),
        (_, None) => Err(NoEstimate::Starting),
        (Some(params), Some(mut sample)) => {
            // Judged as of now: if `sample` has stopped, its readings grow stale.
            sample.time = now();
            let Estimator { state, consistency, .. } = estimator;
            let estimate = step(params, state, &sample);
            Ok(consistency.apply(state.health().last_change(), estimate))
        }
    };
    controller.set_estimate(now(), estimate);
}
