//! Store and session put together: the one owner of what is kept in flash, which takes updates as well.
//!
//! One task owns it and awaits every call to its end, since each may write to flash. Commands come to it by a queue from
//! whoever reads the bus; what it says goes back the same way. A calibration's parameters are made where the caller wants them, not
//! returned: they are large, and what an asynchronous function returns would lie in its task's memory for good.

use embedded_storage_async::nor_flash::NorFlash;
use kou_estimator::units::Micros;

use super::mac::KeySource;
use super::session::{ReadTarget, SessionAction, SessionOutcome, UpdateGuard, UpdateSession};
use super::wire::UpdateAnswer;
use crate::calibration::{
    CalibrationState, LiveCalibration, LoadedCalibration, MachineIdentity, ParamsSlot, load,
};
use crate::diagnostics::{FaultCode, RejectReason};
use crate::outlined_await::await_outlined;
use crate::storage::{
    CrashReport, HealthRecord, Record, RecordKind, Store, StoreError, StoredCalibration, UpdateCounter,
};

/// What a command led to.
#[derive(Debug, Default)]
pub struct CommandOutcome {
    /// To be sent to this address.
    pub answer: Option<(u8, UpdateAnswer)>,
    /// To be recorded as a trouble.
    pub fault: Option<FaultCode>,
    /// A new calibration is in flash and its parameters in their place: to be taken into use between two samples; learned health
    /// begins anew with it.
    pub adopted: Option<CalibrationState>,
}

/// What a start found.
#[derive(Debug, Clone, Copy, Default)]
pub struct StartupCalibration {
    /// The calibration to use; nothing when there is none.
    pub adopted: Option<CalibrationState>,
    /// To be recorded as a trouble.
    pub fault: Option<FaultCode>,
}

impl From<SessionOutcome> for CommandOutcome {
    fn from(outcome: SessionOutcome) -> Self {
        Self { answer: outcome.answer, fault: outcome.rejected.map(FaultCode::UpdateRefused), adopted: None }
    }
}

/// Owner of store and session.
pub struct UpdateService<'d, F: NorFlash, K> {
    store: &'d mut Store<F>,
    session: &'d mut UpdateSession,
    keys: K,
    default: Option<&'d [u8]>,
    counter: u32,
    machine: Option<MachineIdentity>,
}

impl<'d, F: NorFlash, K: KeySource> UpdateService<'d, F, K> {
    /// Puts the two together, which are large and lie elsewhere; nothing is read yet, and no update is taken before [`open`](Self::open). `default` is the
    /// record to use where none is stored.
    pub const fn new(
        store: &'d mut Store<F>,
        session: &'d mut UpdateSession,
        keys: K,
        default: Option<&'d [u8]>,
    ) -> Self {
        Self { store, session, keys, default, counter: u32::MAX, machine: None }
    }

    /// Puts the copies in flash right, finds the calibration to use (the stored one, else the default) and makes its parameters in
    /// `place`.
    pub async fn open(&mut self, place: &mut dyn ParamsSlot) -> StartupCalibration {
        // A copy that cannot be put right is told of by what is loaded, or by the next write.
        if let Some(scratch) = self.session.scratch() {
            await_outlined!(self.store.repair(scratch)).ok();
        }
        let opened = await_outlined!(self.load(place));
        // Behind the calibration's own where power failed between the two writes of an update.
        let alone = self.store.read::<UpdateCounter>().await.ok().flatten();
        if alone.is_none_or(|alone| alone.counter < self.counter) && (1..u32::MAX).contains(&self.counter) {
            self.store.write(&UpdateCounter { counter: self.counter }).await.ok();
        }
        opened
    }

    async fn load(&mut self, place: &mut dyn ParamsSlot) -> StartupCalibration {
        let LoadedCalibration { live, counter, fault } = load(self.store, self.default, place).await;
        self.counter = counter;
        StartupCalibration { adopted: self.activate(live), fault }
    }

    /// Remembers what is in use.
    fn activate(&mut self, live: Option<LiveCalibration>) -> Option<CalibrationState> {
        let LiveCalibration { state, machine } = live?;
        self.machine = Some(machine);
        Some(state)
    }

    /// Takes a command of a tool. `loaded` by [`super::is_loaded`]. The parameters of a new calibration, once it
    /// is in flash, are made in `place`.
    pub async fn receive(
        &mut self,
        now: Micros,
        tool: u8,
        command: [u8; 8],
        loaded: bool,
        place: &mut dyn ParamsSlot,
    ) -> CommandOutcome {
        let guard =
            UpdateGuard { loaded, keys: &self.keys, counter: self.counter, machine: self.machine.as_ref() };
        let outcome = self.session.receive(now, tool, command, &guard);
        match outcome.todo {
            None => outcome.into(),
            Some(SessionAction::Store { counter }) => await_outlined!(self.adopt(counter, place)),
            Some(SessionAction::Fill(ReadTarget::Calibration)) => {
                let default = self.default;
                let stored = self.store.read::<StoredCalibration<'_>>().await.ok().flatten();
                let record = stored.map(|stored| stored.record).filter(|record| !record.is_empty());
                self.session.fill(now, |buffer| copy(record.or(default)?, buffer)).into()
            }
            Some(SessionAction::Fill(what)) => {
                let kind = if what == ReadTarget::Stop { CrashReport::KIND } else { HealthRecord::KIND };
                self.read_out(now, kind).await
            }
        }
    }

    /// A record's body, to be read.
    async fn read_out(&mut self, now: Micros, kind: RecordKind) -> CommandOutcome {
        let body = self.store.read_body(kind).await.ok().flatten();
        self.session.fill(now, |buffer| copy(body?, buffer)).into()
    }

    /// Ends a transfer whose tool has fallen silent; to be called once a second or more often.
    pub fn poll(&mut self, now: Micros) -> CommandOutcome {
        self.session.poll(now).into()
    }

    /// Keeps a record. To be awaited to its end.
    ///
    /// # Errors
    /// As [`Store::write`].
    pub async fn write<'a, R: Record<'a>>(&mut self, record: &R) -> Result<(), StoreError> {
        self.store.write(record).await
    }

    /// The store, for the records that are read at start.
    pub fn store(&mut self) -> &mut Store<F> {
        self.store
    }

    /// Writes the checked calibration, and only then gives it out.
    async fn adopt(&mut self, counter: u32, place: &mut dyn ParamsSlot) -> CommandOutcome {
        let stored = StoredCalibration { counter, record: self.session.record() };
        let is_written = self.store.write(&stored).await.is_ok();
        let live = if is_written { LiveCalibration::stored(self.session.record(), place) } else { None };
        let mut handled = CommandOutcome::from(self.session.stored(is_written));
        handled.adopted = self.activate(live);
        if handled.adopted.is_none() {
            // What is in flash now is known again after a restart; until then nothing more is written over it.
            self.counter = u32::MAX;
            handled.fault = Some(FaultCode::UpdateRefused(RejectReason::Storage));
            return handled;
        }
        self.counter = counter;
        if self.store.write(&UpdateCounter { counter }).await.is_err() {
            // The calibration's own counter holds; the next start tries again.
            handled.fault = Some(FaultCode::StorageFailed);
        }
        handled
    }
}

fn copy(from: &[u8], into: &mut [u8]) -> Option<usize> {
    into.get_mut(..from.len())?.copy_from_slice(from);
    Some(from.len())
}
