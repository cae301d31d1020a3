//! Task `estimate`: the latest sample through the estimator. The only task that holds parameters and state.

use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::Instant;
use kou_estimator::step;

use super::exchange::Active;
use super::{Controller, ESTIMATE_PERIOD, NoEstimate, Pace, now};
use crate::log::info;

/// Estimates for ever. Without parameters it waits for the first ones.
pub async fn run_estimate<M: RawMutex>(controller: &Controller<M>, start: Instant) -> ! {
    let mut pace = Pace::new(start, ESTIMATE_PERIOD, &controller.vitals.estimate);
    let mut active: Option<Active> = None;
    loop {
        pace.turn().await;
        if controller.exchange.serve(&mut active)
            && let Some(active) = &active
        {
            controller.set_calibration(active.calibration);
            info!("calibration in use: {}", active.calibration);
        }
        let estimate = match (&mut active, controller.sample()) {
            (None, _) if controller.calibration().is_none() => Err(NoEstimate::Starting),
            (None, _) => Err(NoEstimate::NoCalibration),
            (_, None) => Err(NoEstimate::Starting),
            (Some(Active { params, state, trust, .. }), Some(mut sample)) => {
                // Judged as of now: if `sample` has stopped, its readings grow stale.
                sample.time = now();
                let estimate = step(params, state, &sample);
                Ok(trust.judge(state.health().last_change(), estimate))
            }
        };
        controller.set_estimate(now(), estimate);
    }
}
