//! Store and session put together: the one owner of what is kept in flash, which takes updates as well.
//!
//! One task owns it and awaits every call to its end, since each may write to flash. Commands come to it by a queue from
//! whoever reads the bus; what it says goes back the same way. A calibration is given out by calling back, not by returning
//! it: it is large, and what an asynchronous function returns would lie in its task's memory for good.

use embedded_storage_async::nor_flash::NorFlash;
use kou_estimator::units::Micros;

use super::session::{Guard, Outcome, Session, Todo, What};
use super::wire::Answer;
use super::{KeySource, Machine, Refusal};
use crate::faults::Code;
use crate::storage::{
    HealthRecord, Kind, Live, Loaded, Record, StopNote, Store, StoreError, StoredCalibration, UpdateCounter,
    load,
};

/// What a command led to.
#[derive(Debug, Default)]
pub struct Handled {
    /// To be sent to this address.
    pub answer: Option<(u8, Answer)>,
    /// To be recorded as a trouble.
    pub trouble: Option<Code>,
}

impl From<Outcome> for Handled {
    fn from(outcome: Outcome) -> Self {
        Self { answer: outcome.answer, trouble: outcome.refused.map(Code::UpdateRefused) }
    }
}

/// Owner of store and session.
pub struct Service<'d, F: NorFlash, K> {
    store: Store<F>,
    session: Session,
    keys: K,
    default: Option<&'d [u8]>,
    counter: u32,
    machine: Option<Machine>,
}

impl<'d, F: NorFlash, K: KeySource> Service<'d, F, K> {
    /// Puts the two together; nothing is read yet, and no update is taken before [`open`](Self::open). `default` is the
    /// record to use where none is stored.
    pub const fn new(store: Store<F>, keys: K, default: Option<&'d [u8]>) -> Self {
        Self { store, session: Session::new(), keys, default, counter: u32::MAX, machine: None }
    }

    /// Puts the copies in flash right, finds the calibration to use (the stored one, else the default) and gives it to
    /// `adopt`. Returns the trouble to be reported, if any.
    pub async fn open(&mut self, adopt: impl FnOnce(Live)) -> Option<Code> {
        // A copy that cannot be put right is told of by what is loaded, or by the next write.
        if let Some(scratch) = self.session.scratch() {
            self.store.heal(scratch).await.ok();
        }
        let trouble = self.load(adopt).await;
        // Behind the calibration's own where power failed between the two writes of an update.
        let alone = self.store.read::<UpdateCounter>().await.ok().flatten();
        if alone.is_none_or(|alone| alone.counter < self.counter) && (1..u32::MAX).contains(&self.counter) {
            self.store.write(&UpdateCounter { counter: self.counter }).await.ok();
        }
        trouble
    }

    async fn load(&mut self, adopt: impl FnOnce(Live)) -> Option<Code> {
        let Loaded { live, counter, trouble } = load(&mut self.store, self.default).await;
        self.counter = counter;
        if let Some(live) = live {
            self.machine = Some(live.machine.clone());
            adopt(live);
        }
        trouble
    }

    /// Takes a command of a tool. `loaded` by [`super::is_loaded`]. A new calibration, once it is in flash, is given to
    /// `adopt`, to be taken into use between two samples; learned health begins anew with it.
    pub async fn receive(
        &mut self,
        now: Micros,
        tool: u8,
        command: [u8; 8],
        loaded: bool,
        adopt: impl FnOnce(Live),
    ) -> Handled {
        let guard = Guard { loaded, keys: &self.keys, counter: self.counter, machine: self.machine.as_ref() };
        let outcome = self.session.receive(now, tool, command, &guard);
        match outcome.todo {
            None => outcome.into(),
            Some(Todo::Store { counter }) => self.adopt(counter, adopt).await,
            Some(Todo::Fill(What::Calibration)) => {
                let default = self.default;
                let stored = self.store.read::<StoredCalibration<'_>>().await.ok().flatten();
                let record = stored.map(|stored| stored.record).filter(|record| !record.is_empty());
                self.session.fill(now, |buffer| copy(record.or(default)?, buffer)).into()
            }
            Some(Todo::Fill(what)) => {
                let kind = if what == What::Stop { StopNote::KIND } else { HealthRecord::KIND };
                self.give(now, kind).await
            }
        }
    }

    /// A record's body, to be read.
    async fn give(&mut self, now: Micros, kind: Kind) -> Handled {
        let body = self.store.read_body(kind).await.ok().flatten();
        self.session.fill(now, |buffer| copy(body?, buffer)).into()
    }

    /// Ends a transfer whose tool has fallen silent; to be called once a second or more often.
    pub fn poll(&mut self, now: Micros) -> Handled {
        self.session.poll(now).into()
    }

    /// Keeps a record. To be awaited to its end.
    ///
    /// # Errors
    /// As [`Store::write`].
    pub async fn keep<'a, R: Record<'a>>(&mut self, record: &R) -> Result<(), StoreError> {
        self.store.write(record).await
    }

    /// The store, for the records that are read at start.
    pub fn store(&mut self) -> &mut Store<F> {
        &mut self.store
    }

    /// Writes the checked calibration, and only then gives it out.
    async fn adopt(&mut self, counter: u32, adopt: impl FnOnce(Live)) -> Handled {
        let stored = StoredCalibration { counter, record: self.session.record() };
        let is_written = self.store.write(&stored).await.is_ok();
        let is_adopted = is_written && self.give_out(counter, adopt);
        let mut handled = Handled::from(self.session.stored(is_written));
        if !is_adopted {
            // What is in flash now is known again after a restart; until then nothing more is written over it.
            self.counter = u32::MAX;
            handled.trouble = Some(Code::UpdateRefused(Refusal::Storage));
        } else if self.store.write(&UpdateCounter { counter }).await.is_err() {
            // The calibration's own counter holds; the next start tries again.
            handled.trouble = Some(Code::StorageFailed);
        }
        handled
    }

    /// Gives out what was written; false when that is no calibration.
    fn give_out(&mut self, counter: u32, adopt: impl FnOnce(Live)) -> bool {
        let Some(live) = Live::stored(self.session.record()) else { return false };
        self.counter = counter;
        self.machine = Some(live.machine.clone());
        adopt(live);
        true
    }
}

fn copy(from: &[u8], into: &mut [u8]) -> Option<usize> {
    into.get_mut(..from.len())?.copy_from_slice(from);
    Some(from.len())
}
