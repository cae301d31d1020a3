//! Task `heartbeat`: logs the link's activity periodically, as a sign of life.

use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::{Duration, Ticker};

use super::channels::ServerChannels;
use crate::link::LinkCounts;
use crate::log::log;

/// Activity of the link during one period.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
enum Activity {
    /// No calibration has been accepted.
    WaitingForCalibration,
    /// Calibrated, but without a sample in this period.
    Idle,
    /// Samples arrive.
    Running,
}

impl Activity {
    fn between(before: &LinkCounts, now: &LinkCounts) -> Self {
        if now.calibrations_accepted == 0 {
            Self::WaitingForCalibration
        } else if now.samples == before.samples {
            Self::Idle
        } else {
            Self::Running
        }
    }
}

/// Runs the heartbeat task; never returns.
pub async fn run_heartbeat<M: RawMutex>(channels: &ServerChannels<M>, period: Duration) -> ! {
    let mut ticker = Ticker::every(period);
    let mut before = channels.counters.read();
    let mut activity = None;
    loop {
        ticker.next().await;
        channels.counters.heartbeats.increment();
        let now = channels.counters.read();
        let present = Activity::between(&before, &now);
        if activity != Some(present) {
            log!(info, "link: {}, {=u32} samples so far", present, now.samples);
            activity = Some(present);
        }
        let (rejected, rejected_before) = (now.frames_rejected(), before.frames_rejected());
        if rejected != rejected_before {
            log!(
                warn,
                "frames rejected: {=u32} since the last beat",
                rejected.saturating_sub(rejected_before)
            );
        }
        before = now;
    }
}
