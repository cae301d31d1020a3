//! Which calibration is live after a start: the stored one when it is whole, readable and passes every check; the default,
//! which the firmware was built or provisioned with, when not. A stored calibration that fails is a trouble, never silently
//! replaced.

use embedded_storage_async::nor_flash::NorFlash;
use kou_estimator::Params;
use kou_estimator::calibration::{MachineConfig, record};

use super::kinds::{StoredCalibration, UpdateCounter};
use super::store::{Store, StoreError};
use crate::faults::Code;
use crate::j1939::{CalibrationSource, CalibrationState};
use crate::update::{Machine, Refusal};

/// A calibration in use.
#[derive(Debug, Clone, PartialEq)]
pub struct Live {
    /// What the estimator works with.
    pub params: Params,
    /// Where it comes from, and its CRC.
    pub state: CalibrationState,
    /// The machine that it is for; updates must be for the same.
    pub machine: Machine,
}

/// What a start found.
#[derive(Debug, Clone, PartialEq)]
pub struct Loaded {
    /// The calibration to use; nothing when there is no good one at all.
    pub live: Option<Live>,
    /// Counter of the last accepted update. Where neither record of it can be read it is the largest there is: no update is
    /// taken then, because any could be an old one, until the workshop erases the storage.
    pub counter: u32,
    /// The trouble to be reported, if any.
    pub trouble: Option<Code>,
}

/// The last four bytes of a record: its CRC-32.
pub(crate) fn crc_of(record: &[u8]) -> u32 {
    record.last_chunk::<4>().map_or(0, |crc| u32::from_le_bytes(*crc))
}

/// Parameters of a record that passes every check, and the machine that it is for.
///
/// # Errors
/// [`Refusal::Record`] or [`Refusal::Field`].
// Not inlined, here and below: what it works with is large and would live in a task's memory for good. And the one place that
// reads records, so that the code for that is there once.
#[inline(never)]
pub(crate) fn checked(bytes: &[u8]) -> Result<(Params, Machine), Refusal> {
    let calibration = record::decode(bytes).map_err(|_| Refusal::Record)?;
    let params = Params::new(&calibration).map_err(|_| Refusal::Field)?;
    let MachineConfig { name, serial, .. } = calibration.machine;
    Ok((params, Machine { name, serial }))
}

#[inline(never)]
fn live(bytes: &[u8], source: CalibrationSource) -> Option<Live> {
    let (params, machine) = checked(bytes).ok()?;
    Some(Live { params, state: CalibrationState { source, crc: crc_of(bytes) }, machine })
}

impl Live {
    /// The calibration of a record that was just stored; nothing when it is not one that passes every check.
    #[must_use]
    pub fn stored(record: &[u8]) -> Option<Self> {
        live(record, CalibrationSource::Stored)
    }
}

/// Reads the stored calibration, or falls back to the `default` record.
pub async fn load<F: NorFlash>(store: &mut Store<F>, default: Option<&[u8]>) -> Loaded {
    let alone = store.read::<UpdateCounter>().await.map(|read| read.map(|read| read.counter));
    let stored = store.read::<StoredCalibration<'_>>().await;
    choose(stored, alone, default)
}

#[inline(never)]
fn choose(
    stored: Result<Option<StoredCalibration<'_>>, StoreError>,
    alone: Result<Option<u32>, StoreError>,
    default: Option<&[u8]>,
) -> Loaded {
    let default = || default.and_then(|bytes| live(bytes, CalibrationSource::Default));
    let known = alone.ok().flatten();
    match stored {
        Ok(None) => Loaded { live: default(), counter: known.unwrap_or(0), trouble: None },
        Ok(Some(StoredCalibration { counter, record })) => {
            let counter = counter.max(known.unwrap_or(0));
            if record.is_empty() {
                return Loaded { live: default(), counter, trouble: None };
            }
            match live(record, CalibrationSource::Stored) {
                Some(live) => Loaded { live: Some(live), counter, trouble: None },
                None => Loaded { live: default(), counter, trouble: Some(Code::CalibrationLost) },
            }
        }
        Err(error) => Loaded {
            live: default(),
            counter: known.unwrap_or(u32::MAX),
            trouble: Some(match error {
                StoreError::Schema { .. } | StoreError::Body(_) => Code::CalibrationLost,
                _ => Code::StorageFailed,
            }),
        },
    }
}
