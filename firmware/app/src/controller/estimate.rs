//! Task `estimate`: the latest sample through the estimator. The only task that holds parameters and state.

use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::Instant;
use kou_estimator::{Params, State, step};

use super::trust::Trust;
use super::{Controller, ESTIMATE_PERIOD, NoEstimate, Pace, now};
use crate::log::info;

/// Estimates for ever. Without parameters it waits for the first candidate.
pub async fn run_estimate<M: RawMutex>(controller: &Controller<M>, start: Instant) -> ! {
    let mut pace = Pace::new(start, ESTIMATE_PERIOD, &controller.vitals.estimate);
    let mut active: Option<(Params, State, Trust)> = None;
    loop {
        pace.turn().await;
        if let Ok(params) = controller.candidate.try_receive() {
            // Swapped between two samples, whole. The state belongs to the old calibration and goes with it.
            active = Some((params, State::new(), Trust::new()));
            info!("new calibration in use");
        }
        let estimate = match (&mut active, controller.sample()) {
            (None, _) => Err(NoEstimate::NoCalibration),
            (_, None) => Err(NoEstimate::Starting),
            (Some((params, state, trust)), Some(mut sample)) => {
                // Judged as of now: if `sample` has stopped, its readings grow stale.
                sample.time = now();
                let estimate = step(params, state, &sample);
                Ok(trust.judge(state.health().last_change(), estimate))
            }
        };
        controller.set_estimate(now(), estimate);
    }
}
