//! Selection of the active calibration at start: the stored record when it is intact, readable and passes every
//! check, else the default that the firmware was built or provisioned with. A stored calibration that fails is
//! reported as a fault, never silently replaced.

use embedded_storage_async::nor_flash::NorFlash;
use kou_estimator::Params;
use kou_estimator::calibration::CalibrationError;
use kou_estimator::calibration::{Calibration, MachineConfig};
use kou_estimator::record;

use super::identity::{CalibrationSource, CalibrationState, MachineIdentity};
use crate::diagnostics::{FaultCode, RejectReason};
use crate::storage::{Store, StoreError, StoredCalibration, UpdateCounter};

/// Storage for parameters, which are too large to be passed by value between functions.
pub trait ParamsSlot {
    /// Builds the parameters of a calibration in this slot, replacing its previous content.
    ///
    /// # Errors
    /// Those of [`Params::new`]; the slot is then empty.
    fn make(&mut self, calibration: &Calibration) -> Result<(), CalibrationError>;
}

impl ParamsSlot for Option<Params> {
    fn make(&mut self, calibration: &Calibration) -> Result<(), CalibrationError> {
        Params::replace(self, calibration)
    }
}

/// Calibration in use; its parameters are in the [`ParamsSlot`] given to [`load`].
#[derive(Debug, Clone, PartialEq)]
pub struct LiveCalibration {
    /// Source and checksum.
    pub state: CalibrationState,
    /// Machine that it is valid for; updates must be for the same machine.
    pub machine: MachineIdentity,
}

/// Result of the selection at start.
#[derive(Debug, Clone, PartialEq)]
pub struct LoadedCalibration {
    /// Calibration to use; `None` when no valid one exists.
    pub live: Option<LiveCalibration>,
    /// Counter of the last accepted update. The maximum when neither record of it can be read: every update is then
    /// rejected as a possible replay until the workshop erases the storage.
    pub counter: u32,
    /// Fault to report, if any.
    pub fault: Option<FaultCode>,
}

/// CRC-32 of a record: its last four bytes.
pub(crate) fn crc_of(record: &[u8]) -> u32 {
    record.last_chunk::<4>().map_or(0, |crc| u32::from_le_bytes(*crc))
}

/// Machine of a record that passes every check.
///
/// # Errors
/// [`RejectReason::Record`] or [`RejectReason::Field`].
pub(crate) fn check_record(bytes: &[u8]) -> Result<MachineIdentity, RejectReason> {
    prepare(bytes, None)
}

/// Checks a record and, given a slot, builds its parameters there.
// Not inlined: its temporaries would otherwise occupy the task's memory permanently. It is also the only caller of
// the decoder, so that the decoder's code exists once.
#[inline(never)]
fn prepare(bytes: &[u8], slot: Option<&mut dyn ParamsSlot>) -> Result<MachineIdentity, RejectReason> {
    // By reference: a copy of a calibration is half a kilobyte.
    let decoded = decode(bytes);
    let calibration = match &decoded {
        Ok(calibration) => calibration,
        Err(reason) => return Err(*reason),
    };
    let made = match slot {
        Some(slot) => slot.make(calibration),
        None => Params::check(calibration),
    };
    made.map_err(|_| RejectReason::Field)?;
    let MachineConfig { name, serial, .. } = &calibration.machine;
    Ok(MachineIdentity { name: name.clone(), serial: serial.clone() })
}

// Not inlined: its temporaries would add to the stack of the parameters' construction.
#[inline(never)]
fn decode(bytes: &[u8]) -> Result<Calibration, RejectReason> {
    record::calibration::decode(bytes).map_err(|_| RejectReason::Record)
}

fn live(bytes: &[u8], source: CalibrationSource, slot: &mut dyn ParamsSlot) -> Option<LiveCalibration> {
    let machine = prepare(bytes, Some(slot)).ok()?;
    Some(LiveCalibration { state: CalibrationState { source, crc: crc_of(bytes) }, machine })
}

impl LiveCalibration {
    /// Calibration of a record that was just stored, with its parameters in `slot`; `None` when it fails a check.
    #[must_use]
    pub fn stored(record: &[u8], slot: &mut dyn ParamsSlot) -> Option<Self> {
        live(record, CalibrationSource::Stored, slot)
    }
}

/// Reads the stored calibration, or falls back to the `default` record; builds the parameters of the selected one in
/// `slot`.
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
    // An empty stored record selects the default.
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
