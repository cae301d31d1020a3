//! State that the tasks share: latest sample and estimate, fault memory, queues of the calibration update.

use core::cell::{Cell, RefCell};
use core::sync::atomic::{AtomicU8, AtomicU32, Ordering};

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_sync::channel::Channel as Queue;
use kou_estimator::units::{Celsius, Micros};
use kou_estimator::{Estimate, Reading, Sample};
use serde::{Deserialize, Serialize};

use super::handover::Handover;
use super::periodic::now;
use super::periods::MAX_ESTIMATE_AGE;
use super::task_stats::AllTaskStats;
use crate::calibration::CalibrationState;
use crate::diagnostics::{FaultCode, FaultMemory, FreezeFrame};
use crate::log::info;
use crate::storage::RecordKind;

/// Capacity of the queues of update commands and of their answers.
const QUEUE: usize = 4;

/// Reason why there is no estimate at all; an invalid estimate has its own reasons.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum NoEstimate {
    /// The tasks have just started, or the flash is still being read.
    Starting,
    /// No calibration is in use.
    NoCalibration,
    /// The estimating task has not completed a cycle for [`MAX_ESTIMATE_AGE`].
    Late,
}

/// State shared by the tasks.
pub struct Controller<M: RawMutex> {
    sample: Mutex<M, Cell<Option<Sample>>>,
    estimate: Mutex<M, Cell<Option<Result<Estimate, NoEstimate>>>>,
    estimated_at: Mutex<M, Cell<Micros>>,
    calibration: Mutex<M, Cell<Option<CalibrationState>>>,
    faults: Mutex<M, RefCell<FaultMemory>>,
    previous_operating_s: AtomicU32,
    writing: AtomicU8,
    /// Parameters and learned health in transit between the tasks `storage` and `estimate`.
    pub handover: Handover<M>,
    /// Commands of a calibration update: source address and data bytes.
    pub commands: Queue<M, (u8, [u8; 8]), QUEUE>,
    /// Answers to them: destination address and data bytes.
    pub answers: Queue<M, (u8, [u8; 8]), QUEUE>,
    external_oil_temperature: Mutex<M, Cell<Reading<Celsius>>>,
    /// Timing statistics of every task.
    pub task_stats: AllTaskStats,
}

impl<M: RawMutex> Controller<M> {
    /// State before the tasks start.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            sample: Mutex::new(Cell::new(None)),
            estimate: Mutex::new(Cell::new(None)),
            estimated_at: Mutex::new(Cell::new(Micros(0))),
            calibration: Mutex::new(Cell::new(None)),
            faults: Mutex::new(RefCell::new(FaultMemory::new())),
            previous_operating_s: AtomicU32::new(0),
            writing: AtomicU8::new(0),
            handover: Handover::new(),
            commands: Queue::new(),
            answers: Queue::new(),
            external_oil_temperature: Mutex::new(Cell::new(Reading::not_fitted())),
            task_stats: AllTaskStats::new(),
        }
    }

    /// Latest sample.
    pub fn sample(&self) -> Option<Sample> {
        self.sample.lock(Cell::get)
    }

    /// Estimate to be published at `now`.
    ///
    /// # Errors
    /// When there is no estimate, or only one that is too old.
    pub fn output(&self, now: Micros) -> Result<Estimate, NoEstimate> {
        let latest = self.estimate.lock(Cell::get).unwrap_or(Err(NoEstimate::Starting));
        let age_us = now.0.saturating_sub(self.estimated_at.lock(Cell::get).0);
        if latest.is_ok() && age_us > MAX_ESTIMATE_AGE.as_micros() { Err(NoEstimate::Late) } else { latest }
    }

    /// Calibration in use; `None` until the flash has been read.
    pub fn calibration(&self) -> Option<CalibrationState> {
        self.calibration.lock(Cell::get)
    }

    pub(super) fn set_calibration(&self, state: CalibrationState) {
        self.calibration.lock(|cell| cell.set(Some(state)));
    }

    /// Gives access to the fault memory. All other tasks are locked out meanwhile: keep it short.
    pub fn faults<R>(&self, access: impl FnOnce(&mut FaultMemory) -> R) -> R {
        self.faults.lock(|memory| access(&mut memory.borrow_mut()))
    }

    /// Freeze frame of the latest sample at the present operating time.
    pub(super) fn freeze_frame(&self) -> FreezeFrame {
        let operating_s = self.operating_s(now());
        self.sample().map_or(FreezeFrame::at(operating_s), |sample| FreezeFrame::of(operating_s, &sample))
    }

    pub(super) fn record_fault_event(&self, code: FaultCode) {
        info!("fault {}", code);
        let frame = self.freeze_frame();
        self.faults(|memory| memory.record_event(code, frame));
    }

    pub(super) fn confirm_fault(&self, code: FaultCode) {
        let frame = self.freeze_frame();
        self.faults(|memory| memory.confirm(code, frame));
    }

    pub(super) fn heal_fault(&self, code: FaultCode) {
        self.faults(|memory| memory.heal(code));
    }

    /// Operating time of the controller at `now`, in seconds: earlier runs plus the present one.
    pub fn operating_s(&self, now: Micros) -> u32 {
        let this_run_s = u32::try_from(now.0 / 1_000_000).unwrap_or(u32::MAX);
        self.previous_operating_s.load(Ordering::Relaxed).saturating_add(this_run_s)
    }

    pub(super) fn set_previous_operating_s(&self, seconds: u32) {
        self.previous_operating_s.store(seconds, Ordering::Relaxed);
    }

    /// Kind of the record that is being written to flash, if any.
    pub fn writing(&self) -> Option<RecordKind> {
        self.writing.load(Ordering::Relaxed).checked_sub(1).and_then(RecordKind::from_number)
    }

    pub(super) fn set_writing(&self, kind: Option<RecordKind>) {
        self.writing.store(kind.map_or(0, |kind| (kind as u8).saturating_add(1)), Ordering::Relaxed);
    }

    pub(super) fn external_oil_temperature(&self) -> Reading<Celsius> {
        self.external_oil_temperature.lock(Cell::get)
    }

    pub(super) fn set_external_oil_temperature(&self, reading: Reading<Celsius>) {
        self.external_oil_temperature.lock(|cell| cell.set(reading));
    }

    pub(super) fn set_sample(&self, sample: Sample) {
        self.sample.lock(|cell| cell.set(Some(sample)));
    }

    pub(super) fn set_estimate(&self, now: Micros, estimate: Result<Estimate, NoEstimate>) {
        self.estimate.lock(|cell| cell.set(Some(estimate)));
        self.estimated_at.lock(|cell| cell.set(now));
    }
}

impl<M: RawMutex> Default for Controller<M> {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use embassy_sync::blocking_mutex::raw::NoopRawMutex;
    use kou_estimator::{Channel, Fault, Reason};

    use super::*;

    #[test]
    fn estimates_become_late_when_the_estimating_task_stops() {
        let controller = Controller::<NoopRawMutex>::new();
        controller.set_estimate(
            Micros(1_000),
            Ok(Estimate::invalid(Micros(1_000), Reason::Sensor(Channel::PumpSpeed, Fault::Stale))),
        );
        assert!(controller.output(Micros(101_000)).is_ok());
        assert_eq!(controller.output(Micros(101_001)), Err(NoEstimate::Late));
    }
}
