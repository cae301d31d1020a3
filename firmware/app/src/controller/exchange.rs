//! What passes between the tasks `store` and `estimate`: parameters and learned health one way, learned health the other.
//!
//! One place for one thing, because each is large. `store` begins every exchange and may put something newer in the place of
//! what still lies there; `estimate` looks at each of its turns, so nothing lies for longer than one. The lock is held for
//! a copy of a kilobyte at most.

use core::cell::RefCell;

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::RawMutex;
use kou_estimator::health::HealthState;
use kou_estimator::{Params, State};

use super::trust::Trust;
use crate::j1939::CalibrationState;
use crate::storage::HealthRecord;

/// What lies there.
#[allow(clippy::large_enum_variant, reason = "there is one, and no heap to box anything")]
enum Slot {
    /// Nothing.
    Empty,
    /// For `estimate`: to be taken into use between two samples.
    Calibration(Params, CalibrationState),
    /// For `estimate`: what was learned with the calibration in use, in an earlier run.
    Learned(HealthState),
    /// For `estimate`: `store` asks for what has been learned.
    Asked,
    /// For `store`: what has been learned.
    Told(HealthRecord),
}

/// The place.
pub struct Exchange<M: RawMutex>(Mutex<M, RefCell<Slot>>);

/// What `estimate` works with.
pub(super) struct Active {
    pub params: Params,
    pub calibration: CalibrationState,
    pub state: State,
    pub trust: Trust,
}

impl<M: RawMutex> Exchange<M> {
    pub(super) const fn new() -> Self {
        Self(Mutex::new(RefCell::new(Slot::Empty)))
    }

    /// Puts a calibration there, to be taken into use between two samples, with a state that has learned nothing.
    pub fn put_calibration(&self, params: Params, state: CalibrationState) {
        self.put(Slot::Calibration(params, state));
    }

    /// Puts there what was learned in an earlier run with the calibration in use.
    pub fn put_learned(&self, state: HealthState) {
        self.put(Slot::Learned(state));
    }

    /// Asks for what has been learned; to be [taken](Self::take_told) after `estimate`'s next turn.
    pub fn ask(&self) {
        self.put(Slot::Asked);
    }

    /// Whether what was put there has been taken.
    pub fn is_free(&self) -> bool {
        self.0.lock(|slot| matches!(*slot.borrow(), Slot::Empty))
    }

    /// What has been learned, when it was asked for.
    pub fn take_told(&self) -> Option<HealthRecord> {
        self.0.lock(|slot| {
            let mut slot = slot.borrow_mut();
            match core::mem::replace(&mut *slot, Slot::Empty) {
                Slot::Told(record) => Some(record),
                other => {
                    *slot = other;
                    None
                }
            }
        })
    }

    fn put(&self, new: Slot) {
        self.0.lock(|slot| *slot.borrow_mut() = new);
    }

    /// The turn of `estimate`: takes what is for it, and answers. True when the calibration has changed.
    pub(super) fn serve(&self, active: &mut Option<Active>) -> bool {
        self.0.lock(|slot| {
            let mut slot = slot.borrow_mut();
            match core::mem::replace(&mut *slot, Slot::Empty) {
                Slot::Empty => false,
                Slot::Calibration(params, calibration) => {
                    // The state belongs to the old calibration and goes with it.
                    *active = Some(Active { params, calibration, state: State::new(), trust: Trust::new() });
                    true
                }
                Slot::Learned(health) => {
                    if let Some(active) = active {
                        active.state = State::with_health(health);
                        active.trust = Trust::new();
                    }
                    false
                }
                Slot::Asked => {
                    if let Some(Active { calibration, state, .. }) = active {
                        let state = state.health().clone();
                        *slot = Slot::Told(HealthRecord { calibration_crc: calibration.crc, state });
                    }
                    false
                }
                told @ Slot::Told(_) => {
                    *slot = told;
                    false
                }
            }
        })
    }
}
