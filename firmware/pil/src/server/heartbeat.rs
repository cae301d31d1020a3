//! Task `heartbeat`: proves that time passes, and logs what has changed since the last beat.

use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::{Duration, Ticker};

use super::channels::ServerChannels;
use crate::link::LinkCounts;
use crate::log::log;

/// What the link is doing, as seen from one beat to the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
enum Activity {
    /// No calibration has been accepted.
    WaitingForCalibration,
    /// Calibrated, but no sample has come since the last beat.
    Idle,
    /// Samples come.
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

/// Beats for ever.
pub async fn run_heartbeat<M: RawMutex>(bus: &ServerChannels<M>, period: Duration) -> ! {
    let mut ticker = Ticker::every(period);
    let mut before = bus.counters.read();
    let mut activity = None;
    loop {
        ticker.next().await;
        bus.counters.heartbeats.increment();
        let now = bus.counters.read();
        let present = Activity::between(&before, &now);
        if activity != Some(present) {
            log!(info, "link: {}, {=u32} samples so far", present, now.samples);
            activity = Some(present);
        }
        let (refused, refused_before) = (now.frames_rejected(), before.frames_rejected());
        if refused != refused_before {
            log!(warn, "frames refused: {=u32} since the last beat", refused.saturating_sub(refused_before));
        }
        before = now;
    }
}
