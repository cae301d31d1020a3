//! Update service: owner of record store and update session.
//!
//! One task owns it and awaits every call to its end, since each may write to flash. Commands arrive through a queue
//! from the task that reads the bus; answers leave the same way. Parameters are built in a slot of the caller instead
//! of being returned: they are large, and a value returned by an asynchronous function occupies its task's memory
//! permanently.

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

/// Outcome of a command.
#[derive(Debug, Default)]
pub struct CommandOutcome {
    /// Answer and its destination address.
    pub answer: Option<(u8, UpdateAnswer)>,
    /// Fault to record.
    pub fault: Option<FaultCode>,
    /// New calibration in flash, with its parameters in their slot: to be activated between two samples; learned
    /// health restarts with it.
    pub adopted: Option<CalibrationState>,
}

/// Result of a start.
#[derive(Debug, Clone, Copy, Default)]
pub struct StartupCalibration {
    /// Calibration to use; `None` when there is none.
    pub adopted: Option<CalibrationState>,
    /// Fault to record.
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
    /// Service over store and session, which are large and live elsewhere. Nothing is read yet, and no update is
    /// accepted before [`open`](Self::open). `default` is the record to use when none is stored.
    pub const fn new(
        store: &'d mut Store<F>,
        session: &'d mut UpdateSession,
        keys: K,
        default: Option<&'d [u8]>,
    ) -> Self {
        Self { store, session, keys, default, counter: u32::MAX, machine: None }
    }

    /// Repairs the copies in flash, selects the calibration to use (the stored one, else the default) and builds its
    /// parameters in `slot`.
    pub async fn open(&mut self, slot: &mut dyn ParamsSlot) -> StartupCalibration {
        // A copy that cannot be repaired is reported by the load that follows, or by the next write.
        if let Some(scratch) = self.session.scratch() {
            await_outlined!(self.store.repair(scratch)).ok();
        }
        let opened = await_outlined!(self.load(slot));
        // Behind the calibration's counter if power failed between the two writes of an update.
        let alone = self.store.read::<UpdateCounter>().await.ok().flatten();
        if alone.is_none_or(|alone| alone.counter < self.counter) && (1..u32::MAX).contains(&self.counter) {
            self.store.write(&UpdateCounter { counter: self.counter }).await.ok();
        }
        opened
    }

    async fn load(&mut self, slot: &mut dyn ParamsSlot) -> StartupCalibration {
        let LoadedCalibration { live, counter, fault } = load(self.store, self.default, slot).await;
        self.counter = counter;
        StartupCalibration { adopted: self.activate(live), fault }
    }

    /// Stores the machine of the calibration in use.
    fn activate(&mut self, live: Option<LiveCalibration>) -> Option<CalibrationState> {
        let LiveCalibration { state, machine } = live?;
        self.machine = Some(machine);
        Some(state)
    }

    /// Handles a command of a tool; `loaded` is the result of [`super::is_loaded`]. The parameters of a new
    /// calibration are built in `slot` once it is in flash.
    pub async fn receive(
        &mut self,
        now: Micros,
        tool: u8,
        command: [u8; 8],
        loaded: bool,
        slot: &mut dyn ParamsSlot,
    ) -> CommandOutcome {
        let guard =
            UpdateGuard { loaded, keys: &self.keys, counter: self.counter, machine: self.machine.as_ref() };
        let outcome = self.session.receive(now, tool, command, &guard);
        match outcome.todo {
            None => outcome.into(),
            Some(SessionAction::Store { counter }) => await_outlined!(self.adopt(counter, slot)),
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

    /// Answers a read request with a record's body.
    async fn read_out(&mut self, now: Micros, kind: RecordKind) -> CommandOutcome {
        let body = self.store.read_body(kind).await.ok().flatten();
        self.session.fill(now, |buffer| copy(body?, buffer)).into()
    }

    /// Ends a transfer after a timeout; to be called at least once a second.
    pub fn poll(&mut self, now: Micros) -> CommandOutcome {
        self.session.poll(now).into()
    }

    /// Writes a record. Must be awaited to its end.
    ///
    /// # Errors
    /// Those of [`Store::write`].
    pub async fn write<'a, R: Record<'a>>(&mut self, record: &R) -> Result<(), StoreError> {
        self.store.write(record).await
    }

    /// Record store, for the records that are read at start.
    pub fn store(&mut self) -> &mut Store<F> {
        self.store
    }

    /// Writes the verified calibration, and activates it only after success.
    async fn adopt(&mut self, counter: u32, slot: &mut dyn ParamsSlot) -> CommandOutcome {
        let stored = StoredCalibration { counter, record: self.session.record() };
        let is_written = self.store.write(&stored).await.is_ok();
        let live = if is_written { LiveCalibration::stored(self.session.record(), slot) } else { None };
        let mut handled = CommandOutcome::from(self.session.stored(is_written));
        handled.adopted = self.activate(live);
        if handled.adopted.is_none() {
            // The content of the flash is unknown until the next start; no further update is accepted before.
            self.counter = u32::MAX;
            handled.fault = Some(FaultCode::UpdateRefused(RejectReason::Storage));
            return handled;
        }
        self.counter = counter;
        if self.store.write(&UpdateCounter { counter }).await.is_err() {
            // The calibration's own counter is in force; the next start repeats the write.
            handled.fault = Some(FaultCode::StorageFailed);
        }
        handled
    }
}

fn copy(from: &[u8], into: &mut [u8]) -> Option<usize> {
    into.get_mut(..from.len())?.copy_from_slice(from);
    Some(from.len())
}
