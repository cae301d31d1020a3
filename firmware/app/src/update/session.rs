//! Controller side of update and read-out: a state machine for one transfer at a time, every step checked.
//!
//! ```text
//! idle --begin--> receiving --data..., commit, all checks--> writing --stored--> idle (activated)
//!  |                 |  rejection, abort, timeout of 1 s --> idle (nothing changed)
//!  '--read--> filling --filled--> reading --timeout of 1 s, begin, abort--> idle
//! ```
//!
//! The session neither writes flash nor activates a calibration: it returns an [action](SessionAction) and is
//! informed of its result. It needs one buffer of its own for one transfer.

use kou_estimator::Sample;
use kou_estimator::record;
use kou_estimator::units::{Megapascal, Micros};

use super::mac::{self, KeySource, TAG_LEN};
use super::sizes::BUFFER_LEN;
use super::wire::{UpdateAnswer, UpdateCommand, segment, transfer_len};
use crate::calibration::MachineIdentity;
use crate::calibration::active::{check_record as check_calibration, crc_of};
use crate::diagnostics::RejectReason;
use crate::log::info;

/// Timeout between two commands of a transfer.
pub const TIME_OUT: Micros = Micros(1_000_000);
/// Shortest record: header and CRC.
const MIN_LEN: usize = 12;
/// Highest pump speed that counts as standstill when the pressure is unknown, r/min.
const STANDSTILL_RPM: f32 = 1.0;

/// Whether the drive is loaded: the pressure difference of the lines is at least `min_difference`, the
/// calibration's `limits.min_pressure_difference_mpa`. Unknown pressure counts as loaded, except at pump standstill:
/// otherwise a calibration with wrong sensor ranges could never be replaced.
#[must_use]
pub fn is_loaded(sample: &Sample, min_difference: Megapascal) -> bool {
    match sample.high_pressure.value {
        Ok(high) => {
            let low = sample.low_pressure.value.map_or(0.0, |low| low.get());
            let difference = high.get() - low;
            // NaN compares false, so it counts as loaded.
            let is_unloaded = difference < min_difference.get();
            !is_unloaded
        }
        Err(_) => !sample.pump_speed.value.is_ok_and(|n| n.get().abs() < STANDSTILL_RPM),
    }
}

/// Conditions that an update must meet.
#[derive(Clone, Copy)]
pub struct UpdateGuard<'a> {
    /// Result of [`is_loaded`].
    pub loaded: bool,
    /// Source of the key.
    pub keys: &'a dyn KeySource,
    /// Counter of the last accepted update.
    pub counter: u32,
    /// Machine of the calibration in use; `None` without one: then the first calibration is accepted.
    pub machine: Option<&'a MachineIdentity>,
}

/// Data that can be read out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ReadTarget {
    /// Record of the calibration in use.
    Calibration,
    /// Learned state as last written: [`crate::storage::HealthRecord`] in postcard's wire format.
    Health,
    /// Last crash: [`crate::storage::CrashReport`] in postcard's wire format.
    Stop,
}

impl ReadTarget {
    const fn number(self) -> u8 {
        match self {
            Self::Calibration => 1,
            Self::Health => 2,
            Self::Stop => 3,
        }
    }

    const fn from_number(number: u8) -> Option<Self> {
        match number {
            1 => Some(Self::Calibration),
            2 => Some(Self::Health),
            3 => Some(Self::Stop),
            _ => None,
        }
    }
}

/// Action requested from the caller.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum SessionAction {
    /// Write [`UpdateSession::record`] with this counter to flash, then call [`UpdateSession::stored`]; then activate
    /// it.
    Store {
        /// Counter of the update.
        counter: u32,
    },
    /// Call [`UpdateSession::fill`] with the data to be read out.
    Fill(ReadTarget),
}

/// Outcome of a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SessionOutcome {
    /// Answer and its destination address.
    pub answer: Option<(u8, UpdateAnswer)>,
    /// Rejection, to be recorded as [`crate::diagnostics::FaultCode::UpdateRefused`].
    pub rejected: Option<RejectReason>,
    /// Action to be performed.
    pub todo: Option<SessionAction>,
}

impl SessionOutcome {
    fn answer(to: u8, answer: UpdateAnswer) -> Self {
        Self { answer: Some((to, answer)), ..Self::default() }
    }

    fn rejection(to: u8, command: u8, reason: RejectReason, detail: u32) -> Self {
        Self {
            rejected: Some(reason),
            ..Self::answer(to, UpdateAnswer::Rejected { command, reason, detail })
        }
    }

    fn todo(todo: SessionAction) -> Self {
        Self { todo: Some(todo), ..Self::default() }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum SessionState {
    Idle,
    Receiving { length: usize, counter: u32, filled: usize },
    Writing { length: usize },
    Filling { what: ReadTarget },
    Reading { length: usize },
}

/// Update session: the one transfer that can be in progress.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct UpdateSession {
    stage: SessionState,
    tool: u8,
    last: Micros,
    buffer: [u8; BUFFER_LEN],
}

impl Default for UpdateSession {
    fn default() -> Self {
        Self::new()
    }
}

impl UpdateSession {
    /// Idle session.
    #[must_use]
    pub const fn new() -> Self {
        Self { stage: SessionState::Idle, tool: 0, last: Micros(0), buffer: [0; BUFFER_LEN] }
    }

    /// Whether no transfer is in progress. The buffer is then available as scratch memory, see
    /// [`scratch`](Self::scratch).
    #[must_use]
    pub fn is_idle(&self) -> bool {
        self.stage == SessionState::Idle
    }

    /// Buffer for other use while idle, as at start-up.
    pub fn scratch(&mut self) -> Option<&mut [u8]> {
        self.is_idle().then_some(&mut self.buffer[..])
    }

    /// Verified record while it is to be written and activated; empty at any other time.
    #[must_use]
    pub fn record(&self) -> &[u8] {
        match self.stage {
            SessionState::Writing { length } => self.buffer.get(..length).unwrap_or_default(),
            _ => &[],
        }
    }

    /// Handles the eight bytes of a tool's command.
    pub fn receive(
        &mut self,
        now: Micros,
        tool: u8,
        command: [u8; 8],
        guard: &UpdateGuard<'_>,
    ) -> SessionOutcome {
        let [number, ..] = command;
        let reject = |reason| SessionOutcome::rejection(tool, number, reason, 0);
        if matches!(self.stage, SessionState::Writing { .. } | SessionState::Filling { .. })
            || !self.is_idle() && tool != self.tool
        {
            return reject(RejectReason::Busy);
        }
        let Some(command) = UpdateCommand::from_bytes(command) else { return reject(RejectReason::Unknown) };
        self.last = now;
        match self.step(tool, command, guard) {
            Ok(outcome) => outcome,
            Err(why) => {
                // The transfer in progress ends: a rejected transfer must be restarted.
                self.stage = SessionState::Idle;
                let detail = if why == RejectReason::OldCounter { guard.counter } else { 0 };
                SessionOutcome::rejection(tool, number, why, detail)
            }
        }
    }

    fn step(
        &mut self,
        tool: u8,
        command: UpdateCommand,
        guard: &UpdateGuard<'_>,
    ) -> Result<SessionOutcome, RejectReason> {
        match (command, self.stage) {
            (UpdateCommand::Begin { length, counter }, _) => {
                self.stage = begin(usize::from(length), counter, guard)?;
                self.tool = tool;
                Ok(SessionOutcome::answer(tool, UpdateAnswer::Begun))
            }
            (UpdateCommand::Data { number, bytes }, SessionState::Receiving { length, counter, filled }) => {
                let filled = self.accept_segment(usize::from(number), &bytes, length, filled)?;
                self.stage = SessionState::Receiving { length, counter, filled };
                Ok(SessionOutcome::answer(
                    tool,
                    UpdateAnswer::SegmentAccepted { next: number.wrapping_add(1) },
                ))
            }
            (UpdateCommand::Commit, SessionState::Receiving { length, counter, filled }) => {
                self.check(length, counter, filled, guard)?;
                self.stage = SessionState::Writing { length };
                Ok(SessionOutcome::todo(SessionAction::Store { counter }))
            }
            (UpdateCommand::Abort, _) => {
                self.stage = SessionState::Idle;
                Ok(SessionOutcome::answer(tool, UpdateAnswer::Aborted))
            }
            (UpdateCommand::Read { what }, SessionState::Idle | SessionState::Reading { .. }) => {
                let what = ReadTarget::from_number(what).ok_or(RejectReason::Unknown)?;
                self.stage = SessionState::Filling { what };
                self.tool = tool;
                Ok(SessionOutcome::todo(SessionAction::Fill(what)))
            }
            (UpdateCommand::Next { number }, SessionState::Reading { length }) => {
                let bytes = self.buffer.get(..length).unwrap_or_default();
                let bytes = segment(bytes, number).ok_or(RejectReason::OutOfOrder)?;
                Ok(SessionOutcome::answer(tool, UpdateAnswer::Segment { number, bytes }))
            }
            (UpdateCommand::Read { .. }, _) => Err(RejectReason::Busy),
            (UpdateCommand::Data { .. } | UpdateCommand::Commit | UpdateCommand::Next { .. }, _) => {
                Err(RejectReason::NoTransfer)
            }
        }
    }

    /// Accepts a segment, which must be the next one in order.
    fn accept_segment(
        &mut self,
        number: usize,
        bytes: &[u8],
        length: usize,
        filled: usize,
    ) -> Result<usize, RejectReason> {
        let total = transfer_len(length);
        let rest = self.buffer.get_mut(filled..total).unwrap_or_default();
        if number.saturating_mul(bytes.len()) != filled || rest.is_empty() {
            return Err(RejectReason::OutOfOrder);
        }
        for (slot, byte) in rest.iter_mut().zip(bytes) {
            *slot = *byte;
        }
        Ok(filled.saturating_add(bytes.len()).min(total))
    }

    /// Verifies every condition before the record is written.
    fn check(
        &self,
        length: usize,
        counter: u32,
        filled: usize,
        guard: &UpdateGuard<'_>,
    ) -> Result<(), RejectReason> {
        if filled < transfer_len(length) {
            return Err(RejectReason::Incomplete);
        }
        if guard.loaded {
            return Err(RejectReason::Loaded);
        }
        // The counter may have been raised in another way since the transfer began.
        if counter <= guard.counter {
            return Err(RejectReason::OldCounter);
        }
        let key = guard.keys.update_key().ok_or(RejectReason::NoKey)?;
        let record = self.buffer.get(..length).ok_or(RejectReason::Length)?;
        let tag =
            self.buffer.get(length..).and_then(|rest| rest.get(..TAG_LEN)).ok_or(RejectReason::Length)?;
        if !mac::is_authentic(&key, counter, record, tag) {
            return Err(RejectReason::Mac);
        }
        check_record(record, guard.machine)
    }

    /// Completes a write and returns the answer to the tool. The record is lost with it: activate it before.
    pub fn stored(&mut self, is_written: bool) -> SessionOutcome {
        let crc = crc_of(self.record());
        if !matches!(core::mem::replace(&mut self.stage, SessionState::Idle), SessionState::Writing { .. }) {
            return SessionOutcome::default();
        }
        if is_written {
            info!("calibration {=u32:08x} accepted over CAN", crc);
            SessionOutcome::answer(self.tool, UpdateAnswer::Committed { crc })
        } else {
            SessionOutcome::rejection(self.tool, 3, RejectReason::Storage, 0)
        }
    }

    /// Supplies the data to be read out: `write` fills a buffer and returns the length, or `None` without data.
    pub fn fill(&mut self, now: Micros, write: impl FnOnce(&mut [u8]) -> Option<usize>) -> SessionOutcome {
        let SessionState::Filling { what } = self.stage else { return SessionOutcome::default() };
        let length = write(&mut self.buffer).filter(|length| *length <= self.buffer.len());
        let Some((length, on_wire)) = length.and_then(|l| Some((l, u16::try_from(l).ok()?))) else {
            self.stage = SessionState::Idle;
            return SessionOutcome::rejection(self.tool, 0x11, RejectReason::NothingStored, 0);
        };
        self.stage = SessionState::Reading { length };
        self.last = now;
        let crc = record::crc32(self.buffer.get(..length).unwrap_or_default());
        SessionOutcome::answer(
            self.tool,
            UpdateAnswer::ReadReady { what: what.number(), length: on_wire, crc },
        )
    }

    /// Ends a transfer after a timeout. To be called about every 100 ms.
    pub fn poll(&mut self, now: Micros) -> SessionOutcome {
        let is_late = now.0.saturating_sub(self.last.0) > TIME_OUT.0;
        match self.stage {
            SessionState::Receiving { .. } if is_late => {
                self.stage = SessionState::Idle;
                SessionOutcome::rejection(self.tool, 2, RejectReason::TimeOut, 0)
            }
            // A tool that stops reading has finished.
            SessionState::Reading { .. } if is_late => {
                self.stage = SessionState::Idle;
                SessionOutcome::default()
            }
            _ => SessionOutcome::default(),
        }
    }
}

fn begin(length: usize, counter: u32, guard: &UpdateGuard<'_>) -> Result<SessionState, RejectReason> {
    if guard.keys.update_key().is_none() {
        return Err(RejectReason::NoKey);
    }
    if guard.loaded {
        return Err(RejectReason::Loaded);
    }
    if counter <= guard.counter {
        return Err(RejectReason::OldCounter);
    }
    if !(MIN_LEN..=record::calibration::MAX_LEN).contains(&length) {
        return Err(RejectReason::Length);
    }
    Ok(SessionState::Receiving { length, counter, filled: 0 })
}

/// Checks the whole record: readable, valid by the estimator's checks, and for this machine.
fn check_record(bytes: &[u8], machine: Option<&MachineIdentity>) -> Result<(), RejectReason> {
    let candidate = check_calibration(bytes)?;
    if machine.is_some_and(|machine| !machine.accepts(&candidate)) {
        return Err(RejectReason::WrongMachine);
    }
    Ok(())
}
