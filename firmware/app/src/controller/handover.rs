//! What passes between the tasks `store` and `estimate`: parameters and learned health one way, learned health the other.
//!
//! One place for one thing, because each is large, and each is made where it lies: a copy on its way would take the stack that the
//! place saves. `store` begins every exchange and may put something newer in the place of what still lies there; `estimate` looks
//! at each of its cycles, never waits, and takes what is for it by exchanging contents. While `store` works at the place,
//! `estimate` passes by; nobody else is held up.

use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_sync::mutex::{Mutex, MutexGuard};
use kou_estimator::calibration::check::CalibrationError;
use kou_estimator::health::HealthState;
use kou_estimator::{Calibration, Params, State};

use super::consistency::ConsistencyCheck;
use crate::calibration::{CalibrationState, ParamsSlot};
use crate::diagnostics::FaultMemory;
use crate::storage::HealthRecord;

/// What lies there.
#[allow(clippy::large_enum_variant, reason = "there is one, and no heap to box anything")]
pub(super) enum Mailbox {
    /// Nothing.
    Empty,
    /// Parameters: being made, until it is said of what calibration; then for `estimate`, to be taken into use between two samples.
    Calibration(Option<Params>, Option<CalibrationState>),
    /// For `estimate`: what was learned with the calibration in use, in an earlier run.
    Learned(HealthState),
    /// For `estimate`, to be filled with what has been learned; then for `store`.
    Requested {
        /// What has been learned, once it is told.
        record: HealthRecord,
        /// Whether it is.
        is_filled: bool,
    },
    /// Of `store` alone: the fault memory while it is written. It has nothing to do with `estimate`, but needs a place for a moment.
    Faults(FaultMemory),
}

impl Mailbox {
    /// Asks for what has been learned.
    // Not inlined: what is put here would lie in a task's memory for good.
    #[inline(never)]
    pub fn request_learned(&mut self) {
        let record = HealthRecord { calibration_crc: 0, state: HealthState::new() };
        *self = Self::Requested { record, is_filled: false };
    }

    /// Hands over what was learned in an earlier run.
    #[inline(never)]
    pub fn put_learned(&mut self, health: &HealthState) {
        *self = Self::Learned(health.clone());
    }

    /// The parameters made here are those of this calibration, and to be taken into use.
    pub fn release(&mut self, calibration: CalibrationState) {
        if let Self::Calibration(_, state) = self {
            *state = Some(calibration);
        }
    }

    /// The parameters, where any were made.
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
            // Not to lie in the way of what comes next.
            *self = Self::Empty;
        }
        made
    }
}

/// The place.
pub struct Handover<M: RawMutex>(Mutex<M, Mailbox>);

/// What the task `estimate` works with. It lies outside of the task, which is moved when it is begun.
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

    /// The place, for `store` to work at. Waits for no longer than a turn of `estimate`.
    pub(super) async fn lock(&self) -> MutexGuard<'_, M, Mailbox> {
        self.0.lock().await
    }

    /// The turn of `estimate`: takes what is for it, and answers. True when the calibration has changed.
    pub(super) fn serve(&self, estimator: &mut Estimator) -> bool {
        let Ok(mut slot) = self.0.try_lock() else { return false };
        match &mut *slot {
            // Not complete, or not for this task.
            Mailbox::Empty | Mailbox::Calibration(_, None) | Mailbox::Faults(_) => {}
            Mailbox::Calibration(params, Some(calibration)) => {
                core::mem::swap(&mut estimator.params, params);
                estimator.calibration = *calibration;
                // The state belongs to the old calibration and goes with it.
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

// Not inlined, each of them: what one copies would lie on the stack beside what the others do.
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
