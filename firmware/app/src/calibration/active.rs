//! Which calibration is live after a start: the stored one when it is whole, readable and passes every check; the default,
//! which the firmware was built or provisioned with, when not. A stored calibration that fails is a fault, never silently
//! replaced.

use embedded_storage_async::nor_flash::NorFlash;
use kou_estimator::Params;
use kou_estimator::calibration::check::CalibrationError;
use kou_estimator::calibration::{Calibration, MachineConfig, record};

use super::identity::{CalibrationSource, CalibrationState, MachineIdentity};
use crate::diagnostics::{FaultCode, RejectReason};
use crate::storage::{Store, StoreError, StoredCalibration, UpdateCounter};

/// Where parameters are made: they are too large to be handed from one function to the next.
pub trait ParamsSlot {
    /// Makes the parameters of a calibration here, in the slot of what was here before.
    ///
    /// # Errors
    /// As [`Params::new`]; then nothing is here.
    fn make(&mut self, calibration: &Calibration) -> Result<(), CalibrationError>;
}

impl ParamsSlot for Option<Params> {
    fn make(&mut self, calibration: &Calibration) -> Result<(), CalibrationError> {
        Params::replace(self, calibration)
    }
}

/// A calibration in use; its parameters lie in the [`ParamsSlot`] that was given.
#[derive(Debug, Clone, PartialEq)]
pub struct LiveCalibration {
    /// Where it comes from, and its CRC.
    pub state: CalibrationState,
    /// The machine that it is for; updates must be for the same.
    pub machine: MachineIdentity,
}

/// What a start selected.
#[derive(Debug, Clone, PartialEq)]
pub struct LoadedCalibration {
    /// The calibration to use; nothing when there is no good one at all.
    pub live: Option<LiveCalibration>,
    /// Counter of the last accepted update. Where neither record of it can be read it is the largest there is: no update is
    /// taken then, because any could be an old one, until the workshop erases the storage.
    pub counter: u32,
    /// The trouble to be reported, if any.
    pub fault: Option<FaultCode>,
}

/// The last four bytes of a record: its CRC-32.
pub(crate) fn crc_of(record: &[u8]) -> u32 {
    record.last_chunk::<4>().map_or(0, |crc| u32::from_le_bytes(*crc))
}

/// The machine of a record that passes every check.
///
/// # Errors
/// [`RejectReason::Record`] or [`RejectReason::Field`].
pub(crate) fn check_record(bytes: &[u8]) -> Result<MachineIdentity, RejectReason> {
    prepare(bytes, None)
}

/// The same; and the parameters are made in the slot, where there is one.
// Not inlined: what it works with is large and would live in a task's memory for good. And the one slot that
// reads records, so that the code for that is there once.
#[inline(never)]
fn prepare(bytes: &[u8], slot: Option<&mut dyn ParamsSlot>) -> Result<MachineIdentity, RejectReason> {
    // By reference, since every copy of it is half a kilobyte.
    let decoded = decode(bytes);
    let calibration = match &decoded {
        Ok(calibration) => calibration,
        Err(refusal) => return Err(*refusal),
    };
    let made = match slot {
        Some(slot) => slot.make(calibration),
        None => Params::check(calibration),
    };
    made.map_err(|_| RejectReason::Field)?;
    let MachineConfig { name, serial, .. } = &calibration.machine;
    Ok(MachineIdentity { name: name.clone(), serial: serial.clone() })
}

// Not inlined: what it takes would lie on the stack beside the parameters.
#[inline(never)]
fn decode(bytes: &[u8]) -> Result<Calibration, RejectReason> {
    record::decode(bytes).map_err(|_| RejectReason::Record)
}

fn live(bytes: &[u8], source: CalibrationSource, slot: &mut dyn ParamsSlot) -> Option<LiveCalibration> {
    let machine = prepare(bytes, Some(slot)).ok()?;
    Some(LiveCalibration { state: CalibrationState { source, crc: crc_of(bytes) }, machine })
}

impl LiveCalibration {
    /// The calibration of a record that was just stored, its parameters in `slot`; nothing when it is not one that passes every
    /// check.
    #[must_use]
    pub fn stored(record: &[u8], slot: &mut dyn ParamsSlot) -> Option<Self> {
        live(record, CalibrationSource::Stored, slot)
    }
}

/// Reads the stored calibration, or falls back to the `default` record. The parameters of what is to be used are made in `slot`.
pub async fn load<F: NorFlash>(
    store: &mut Store<F>,
    default: Option<&[u8]>,
    slot: &mut dyn ParamsSlot,
) -> LoadedCalibration {
    let stored_counter = store.read::<UpdateCounter>().await.map(|read| read.map(|read| read.counter));
    let stored = store.read::<StoredCalibration<'_>>().await;
    select(stored, stored_counter, default, slot)
}

#[inline(never)]
fn select(
    stored: Result<Option<StoredCalibration<'_>>, StoreError>,
    stored_counter: Result<Option<u32>, StoreError>,
    default: Option<&[u8]>,
    slot: &mut dyn ParamsSlot,
) -> LoadedCalibration {
    let mut fault = None;
    let known = stored_counter.ok().flatten();
    // What is stored, if it is anything; an empty record says that the default is to be used.
    let (counter, record) = match stored {
        Ok(None) => (known.unwrap_or(0), &[][..]),
        Ok(Some(StoredCalibration { counter, record })) => (counter.max(known.unwrap_or(0)), record),
        Err(error) => {
            fault = Some(match error {
                StoreError::Schema { .. } | StoreError::Body(_) => FaultCode::CalibrationLost,
                _ => FaultCode::StorageFailed,
            });
            (known.unwrap_or(u32::MAX), &[][..])
        }
    };
    let mut selected = None;
    if !record.is_empty() {
        selected = live(record, CalibrationSource::Stored, slot);
        if selected.is_none() {
            fault = Some(FaultCode::CalibrationLost);
        }
    }
    if selected.is_none() {
        selected = default.and_then(|bytes| live(bytes, CalibrationSource::Default, slot));
    }
    LoadedCalibration { live: selected, counter, fault }
}
