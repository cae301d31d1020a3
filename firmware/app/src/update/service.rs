//! Store and session put together: the one owner of what is kept in flash, which takes updates as well.
//!
//! One task owns it and awaits every call to its end, since each may write to flash. Commands come to it by a queue from
//! whoever reads the bus; what it says goes back the same way.

use embedded_storage_async::nor_flash::NorFlash;
use kou_estimator::units::Micros;

use super::session::{Guard, Outcome, Session, Todo, What};
use super::wire::Answer;
use super::{KeySource, Machine, Refusal};
use crate::faults::Code;
use crate::storage::{HealthRecord, Live, Loaded, Record, Store, StoreError, StoredCalibration, load};

/// What a command led to.
#[derive(Debug, Default)]
pub struct Handled {
    /// To be sent to this address.
    pub answer: Option<(u8, Answer)>,
    /// To be recorded as a trouble.
    pub trouble: Option<Code>,
    /// The new calibration, to be taken into use between two samples; learned health begins anew with it.
    pub live: Option<Live>,
}

impl From<Outcome> for Handled {
    fn from(outcome: Outcome) -> Self {
        Self { answer: outcome.answer, trouble: outcome.refused.map(Code::UpdateRefused), live: None }
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
    /// Puts the copies in flash right and finds the calibration to use: the stored one, else the `default` record.
    pub async fn start(store: Store<F>, keys: K, default: Option<&'d [u8]>) -> (Self, Loaded) {
        let mut service =
            Self { store, session: Session::new(), keys, default, counter: u32::MAX, machine: None };
        // A copy that cannot be put right is told of by what is loaded, or by the next write.
        if let Some(scratch) = service.session.scratch() {
            service.store.heal(scratch).await.ok();
        }
        let loaded = load(&mut service.store, default).await;
        service.counter = loaded.counter;
        service.machine = loaded.live.as_ref().map(|live| live.machine.clone());
        (service, loaded)
    }

    /// Takes a command of a tool. `loaded` by [`super::is_loaded`]; `health` is what is read as the learned state.
    pub async fn receive(
        &mut self,
        now: Micros,
        tool: u8,
        command: [u8; 8],
        loaded: bool,
        health: Option<&HealthRecord>,
    ) -> Handled {
        let guard = Guard { loaded, keys: &self.keys, counter: self.counter, machine: self.machine.as_ref() };
        let outcome = self.session.receive(now, tool, command, &guard);
        match outcome.todo {
            None => outcome.into(),
            Some(Todo::Store { counter }) => self.adopt(counter).await,
            Some(Todo::Fill(What::Calibration)) => {
                let default = self.default;
                let stored = self.store.read::<StoredCalibration<'_>>().await.ok().flatten();
                let record = stored.map(|stored| stored.record).filter(|record| !record.is_empty());
                let fill = |buffer: &mut [u8]| {
                    let record = record.or(default)?;
                    buffer.get_mut(..record.len())?.copy_from_slice(record);
                    Some(record.len())
                };
                self.session.fill(now, fill).into()
            }
            Some(Todo::Fill(What::Health)) => {
                let fill =
                    |buffer: &mut [u8]| postcard::to_slice(health?, buffer).ok().map(|written| written.len());
                self.session.fill(now, fill).into()
            }
        }
    }

    /// Ends a transfer whose tool has fallen silent; to be called every 100 ms or so.
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
    async fn adopt(&mut self, counter: u32) -> Handled {
        let stored = StoredCalibration { counter, record: self.session.record() };
        let is_written = self.store.write(&stored).await.is_ok();
        let live = if is_written { Live::stored(self.session.record()) } else { None };
        let mut handled = Handled::from(self.session.stored(is_written));
        if let Some(live) = live {
            self.counter = counter;
            self.machine = Some(live.machine.clone());
            handled.live = Some(live);
        } else {
            // What is in flash now is known again after a restart; until then nothing more is written over it.
            self.counter = u32::MAX;
            handled.trouble = Some(Code::UpdateRefused(Refusal::Storage));
        }
        handled
    }
}
