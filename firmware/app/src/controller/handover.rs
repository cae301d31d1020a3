//! Handover between the tasks `storage` and `estimate`: parameters and learned health in one direction, learned
//! health in the other.
//!
//! A single mailbox holds one item at a time, because each item is large and is built in place: copying it would need
//! as much stack as the mailbox saves. `storage` starts every handover and may replace an item that has not been
//! collected; `estimate` checks the mailbox in each cycle without waiting, and takes its item by swapping contents.
//! While `storage` works on the mailbox, `estimate` skips it; no other task is blocked.

use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_sync::mutex::{Mutex, MutexGuard};
use kou_estimator::calibration::CalibrationError;
use kou_estimator::health::HealthState;
use kou_estimator::{Calibration, Params, State};

use super::consistency::ConsistencyCheck;
use crate::calibration::{CalibrationState, ParamsSlot};
use crate::diagnostics::FaultMemory;
use crate::storage::HealthRecord;

/// Content of the mailbox.
#[allow(clippy::large_enum_variant, reason = "there is one, and no heap to box anything")]
pub(super) enum Mailbox {
    /// Nothing.
    Empty,
    /// Parameters: under construction while the second field is `None`; then for `estimate`, to be activated between
    /// two samples.
    Calibration(Option<Params>, Option<CalibrationState>),
    /// For `estimate`: health learned with the calibration in use, in an earlier run.
    Learned(HealthState),
    /// Request to `estimate` for the learned health; once filled, for `storage`.
    Requested {
        /// Learned health, once filled in.
        record: HealthRecord,
        /// Whether the record is filled in.
        is_filled: bool,
    },
    /// Used by `storage` alone: the fault memory while it is written, which needs a buffer for a moment.
    Faults(FaultMemory),
}

impl Mailbox {
    /// Requests the learned health.
    // Not inlined: the record would otherwise occupy a task's memory permanently.
    #[inline(never)]
    pub fn request_learned(&mut self) {
        let record = HealthRecord { calibration_crc: 0, state: HealthState::new() };
        *self = Self::Requested { record, is_filled: false };
    }

    /// Hands over health that was learned in an earlier run.
    #[inline(never)]
    pub fn put_learned(&mut self, health: &HealthState) {
        *self = Self::Learned(health.clone());
    }

    /// Releases the parameters in the mailbox to `estimate`, as those of this calibration.
    pub fn release(&mut self, calibration: CalibrationState) {
        if let Self::Calibration(_, state) = self {
            *state = Some(calibration);
        }
    }

    /// Parameters in the mailbox, if any.
    pub fn params(&self) -> Option<&Params> {
        match self {
            Self::Calibration(params, _) => params.as_ref(),
            _ => None,
        }
    }
}

impl ParamsSlot for Mailbox {
    fn make(&mut self, calibration: &Calibration) -> Result<(), CalibrationError> {
        *self = Self::Calibration(None, None);
        let made = match self {
            Self::Calibration(place, _) => place.make(calibration),
            _ => Ok(()),
        };
        if made.is_err() {
            // Must not block the next item.
            *self = Self::Empty;
        }
        made
    }
}

/// Mailbox between `storage` and `estimate`.
pub struct Handover<M: RawMutex>(Mutex<M, Mailbox>);

/// Working data of the task `estimate`. Outside the task, because a task is moved when it is started.
pub struct Estimator {
    pub(super) params: Option<Params>,
    pub(super) calibration: CalibrationState,
    pub(super) state: State,
    pub(super) consistency: ConsistencyCheck,
}

impl Estimator {
    /// Before the first calibration.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            params: None,
            calibration: CalibrationState::NONE,
            state: State::new(),
            consistency: ConsistencyCheck::new(),
        }
    }
}

impl Default for Estimator {
    fn default() -> Self {
        Self::new()
    }
}

impl<M: RawMutex> Handover<M> {
    pub(super) const fn new() -> Self {
        Self(Mutex::new(Mailbox::Empty))
    }

    /// Locks the mailbox for `storage`. Waits no longer than one cycle of `estimate`.
    pub(super) async fn lock(&self) -> MutexGuard<'_, M, Mailbox> {
        self.0.lock().await
    }

    /// Serves `estimate` in its cycle: takes its item, and fills in a request. Returns true when the calibration has
    /// changed.
    pub(super) fn serve(&self, estimator: &mut Estimator) -> bool {
        let Ok(mut slot) = self.0.try_lock() else { return false };
        match &mut *slot {
            // Not complete, or not for this task.
            Mailbox::Empty | Mailbox::Calibration(_, None) | Mailbox::Faults(_) => {}
            Mailbox::Calibration(params, Some(calibration)) => {
                core::mem::swap(&mut estimator.params, params);
                estimator.calibration = *calibration;
                // The state belongs to the previous calibration and is discarded with it.
                estimator.reset();
                *slot = Mailbox::Empty;
                return true;
            }
            Mailbox::Learned(health) => {
                if estimator.params.is_some() {
                    estimator.resume_with(health);
                }
                *slot = Mailbox::Empty;
            }
            Mailbox::Requested { record, is_filled } if estimator.params.is_some() => {
                if !*is_filled {
                    estimator.export_learned(record);
                    *is_filled = true;
                }
            }
            Mailbox::Requested { .. } => *slot = Mailbox::Empty,
        }
        false
    }
}

// Not inlined, each of them: their temporaries would otherwise share one stack frame.
impl Estimator {
    #[inline(never)]
    fn reset(&mut self) {
        self.state = State::new();
        self.consistency = ConsistencyCheck::new();
    }

    #[inline(never)]
    fn resume_with(&mut self, health: &HealthState) {
        self.state = State::with_health(health.clone());
        self.consistency = ConsistencyCheck::new();
    }

    #[inline(never)]
    fn export_learned(&self, record: &mut HealthRecord) {
        record.calibration_crc = self.calibration.crc;
        record.state.clone_from(self.state.health());
    }
}
