//! The controller: sensors in, estimates out, by tasks of fixed period and priority, watched over.
//!
//! ```text
//!            1 kHz            100 Hz               100 Hz
//! front end --> sample --sample--> estimate --estimate--> publish <--> CAN
//!                                    ^  |                 |   ^
//!            calibration, learned ---+--+--- learned   commands, answers
//!                                    |  v                 v   |
//!                                    store (1 Hz) <-------------
//!                                      `--> flash
//!
//! every task --check-in--> supervise (20 Hz) --feeds--> watchdog
//! ```
//!
//! | task | period | priority | deadline | silent for at most |
//! |---|---|---|---|---|
//! | [`run_sample`] | 1 ms | highest | 1 ms | 20 ms |
//! | [`run_estimate`] | 10 ms | high | 10 ms | 100 ms |
//! | [`run_publish`] | 10 ms | low | 10 ms | 1 s |
//! | [`run_store`] | 1 s | low | 1 s | 10 s |
//! | [`run_supervise`] | 50 ms | low | 50 ms | the watchdog's time |
//!
//! The tasks know no board: a board gives them a [`FrontEnd`], a [`Publish`], a flash and a [`Watchdog`], and runs each
//! in an executor of its priority. They share one [`Controller`], which lives in a static. What passes
//! from task to task is the latest value: a task that is late finds a newer one, never a queue. Only commands of a
//! calibration update and their answers queue, a few of each.
//!
//! Safe state: the firmware has no actuator, so nothing that it does can disturb the drive. Whatever fails, the
//! estimate is told as invalid with its reason ([`Controller::output`]), and silence on the bus is at most as long as
//! the watchdog's time.

mod bus;
mod estimate;
mod exchange;
mod keep;
pub mod note;
mod pace;
mod publish;
mod sample;
mod store;
mod supervise;
#[cfg(test)]
mod tests;
mod trust;
mod vital;

pub use bus::{Bus, CanPort};
pub use estimate::run_estimate;
pub use exchange::{Estimator, Exchange};
pub use keep::{KeepConfig, KeepError, KeepParams};
pub use pace::Pace;
pub use publish::{Publish, run_publish};
pub use sample::{EdgeTimer, FrontEnd, Sampler, SensorsMemory, run_sample};
pub use store::{Begin, Keeper, run_store};
pub use supervise::{Supervisor, Task, Watchdog, run_supervise};
pub use vital::{Vital, Vitals, VitalsRead};

use core::cell::{Cell, RefCell};
use core::sync::atomic::{AtomicU8, AtomicU32, Ordering};

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_sync::channel::Channel;
use embassy_time::Duration;
use kou_estimator::units::{Celsius, Micros};
use kou_estimator::{Estimate, Reading, Sample};
use serde::{Deserialize, Serialize};

use crate::faults::{Code, FaultMemory, Snapshot};
use crate::j1939::CalibrationState;
use crate::log::info;
use crate::storage::Kind;

/// Period of [`run_sample`].
pub const SAMPLE_PERIOD: Duration = Duration::from_millis(1);
/// Period of [`run_estimate`].
pub const ESTIMATE_PERIOD: Duration = Duration::from_millis(10);
/// Period of [`run_publish`].
pub const PUBLISH_PERIOD: Duration = Duration::from_millis(10);
/// Period of [`run_store`].
pub const STORE_PERIOD: Duration = Duration::from_secs(1);
/// Period of [`run_supervise`].
pub const SUPERVISE_PERIOD: Duration = Duration::from_millis(50);
/// Age at which an estimate is no longer told.
pub const MAX_ESTIMATE_AGE: Duration = Duration::from_millis(100);

/// Commands and answers of a calibration update that may wait.
const QUEUE: usize = 4;

/// Why there is no estimate at all; an estimate that is invalid has its own reasons.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum NoEstimate {
    /// The tasks have just begun, or what is kept in flash is still being read.
    Starting,
    /// No calibration is in use.
    NoCalibration,
    /// The estimating task has not come to its turn for [`MAX_ESTIMATE_AGE`].
    Late,
}

/// What the tasks share.
pub struct Controller<M: RawMutex> {
    sample: Mutex<M, Cell<Option<Sample>>>,
    estimate: Mutex<M, Cell<Option<Result<Estimate, NoEstimate>>>>,
    told_at: Mutex<M, Cell<Micros>>,
    calibration: Mutex<M, Cell<Option<CalibrationState>>>,
    faults: Mutex<M, RefCell<FaultMemory>>,
    operated_before_s: AtomicU32,
    writing: AtomicU8,
    /// Parameters and learned health on their way between [`run_store`] and [`run_estimate`].
    pub exchange: Exchange<M>,
    /// Commands of a calibration update: who sent them, and their bytes.
    pub commands: Channel<M, (u8, [u8; 8]), QUEUE>,
    /// Answers to them: for whom, and their bytes.
    pub answers: Channel<M, (u8, [u8; 8]), QUEUE>,
    oil_heard: Mutex<M, Cell<Reading<Celsius>>>,
    /// How every task is doing.
    pub vitals: Vitals,
}

impl<M: RawMutex> Controller<M> {
    /// Before the tasks start.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            sample: Mutex::new(Cell::new(None)),
            estimate: Mutex::new(Cell::new(None)),
            told_at: Mutex::new(Cell::new(Micros(0))),
            calibration: Mutex::new(Cell::new(None)),
            faults: Mutex::new(RefCell::new(FaultMemory::new())),
            operated_before_s: AtomicU32::new(0),
            writing: AtomicU8::new(0),
            exchange: Exchange::new(),
            commands: Channel::new(),
            answers: Channel::new(),
            oil_heard: Mutex::new(Cell::new(Reading::not_fitted())),
            vitals: Vitals::new(),
        }
    }

    /// The latest sample.
    pub fn sample(&self) -> Option<Sample> {
        self.sample.lock(Cell::get)
    }

    /// What is to be told of leakage at `now`.
    ///
    /// # Errors
    /// When there is no estimate, or only one that is too old.
    pub fn output(&self, now: Micros) -> Result<Estimate, NoEstimate> {
        let latest = self.estimate.lock(Cell::get).unwrap_or(Err(NoEstimate::Starting));
        let age_us = now.0.saturating_sub(self.told_at.lock(Cell::get).0);
        if latest.is_ok() && age_us > MAX_ESTIMATE_AGE.as_micros() { Err(NoEstimate::Late) } else { latest }
    }

    /// The calibration in use; nothing until what is kept in flash has been read.
    pub fn calibration(&self) -> Option<CalibrationState> {
        self.calibration.lock(Cell::get)
    }

    fn set_calibration(&self, state: CalibrationState) {
        self.calibration.lock(|cell| cell.set(Some(state)));
    }

    /// Looks at the fault memory, or changes it. No other task runs meanwhile: be short.
    pub fn faults<R>(&self, look: impl FnOnce(&mut FaultMemory) -> R) -> R {
        self.faults.lock(|memory| look(&mut memory.borrow_mut()))
    }

    /// What is measured now, at the present operating time.
    fn snapshot(&self) -> Snapshot {
        let operating_s = self.operating_s(now());
        self.sample().map_or(Snapshot::at(operating_s), |sample| Snapshot::of(operating_s, &sample))
    }

    fn happened(&self, code: Code) {
        info!("trouble {}", code);
        let snapshot = self.snapshot();
        self.faults(|memory| memory.happened(code, snapshot));
    }

    fn confirmed(&self, code: Code) {
        let snapshot = self.snapshot();
        self.faults(|memory| memory.confirmed(code, snapshot));
    }

    fn healed(&self, code: Code) {
        self.faults(|memory| memory.healed(code));
    }

    /// Operating time of the controller at `now`, in seconds: that of earlier runs and that of this one.
    pub fn operating_s(&self, now: Micros) -> u32 {
        let this_run_s = u32::try_from(now.0 / 1_000_000).unwrap_or(u32::MAX);
        self.operated_before_s.load(Ordering::Relaxed).saturating_add(this_run_s)
    }

    fn set_operated_before(&self, seconds: u32) {
        self.operated_before_s.store(seconds, Ordering::Relaxed);
    }

    /// The record that is being written to flash, if any.
    pub fn writing(&self) -> Option<Kind> {
        self.writing.load(Ordering::Relaxed).checked_sub(1).and_then(Kind::from_number)
    }

    fn set_writing(&self, kind: Option<Kind>) {
        self.writing.store(kind.map_or(0, |kind| (kind as u8).saturating_add(1)), Ordering::Relaxed);
    }

    fn oil_heard(&self) -> Reading<Celsius> {
        self.oil_heard.lock(Cell::get)
    }

    fn set_oil_heard(&self, reading: Reading<Celsius>) {
        self.oil_heard.lock(|cell| cell.set(reading));
    }

    fn set_sample(&self, sample: Sample) {
        self.sample.lock(|cell| cell.set(Some(sample)));
    }

    fn set_estimate(&self, now: Micros, estimate: Result<Estimate, NoEstimate>) {
        self.estimate.lock(|cell| cell.set(Some(estimate)));
        self.told_at.lock(|cell| cell.set(now));
    }
}

impl<M: RawMutex> Default for Controller<M> {
    fn default() -> Self {
        Self::new()
    }
}

/// The clock of the tasks as the estimator states time.
fn now() -> Micros {
    Micros(embassy_time::Instant::now().as_micros())
}
