//! Which calibration is live after a start: the stored one when it is whole, readable and passes every check; the default,
//! which the firmware was built with, when not. A stored calibration that fails is a trouble, never silently replaced.

use embedded_storage_async::nor_flash::NorFlash;
use kou_estimator::Params;
use kou_estimator::calibration::{MachineConfig, record};

use super::kinds::StoredCalibration;
use super::store::{Store, StoreError};
use crate::faults::Code;
use crate::j1939::{CalibrationSource, CalibrationState};
use crate::update::Machine;

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
    /// Counter of the last accepted update. Where it cannot be read it is the largest there is: no update is taken then,
    /// because any could be an old one, until the workshop erases the storage.
    pub counter: u32,
    /// The trouble to be reported, if any.
    pub trouble: Option<Code>,
}

/// The last four bytes of a record: its CRC-32.
pub(crate) fn crc_of(record: &[u8]) -> u32 {
    record.last_chunk::<4>().map_or(0, |crc| u32::from_le_bytes(*crc))
}

fn live(bytes: &[u8], source: CalibrationSource) -> Option<Live> {
    let calibration = record::decode(bytes).ok()?;
    let params = Params::new(&calibration).ok()?;
    let MachineConfig { name, serial, .. } = calibration.machine;
    Some(Live {
        params,
        state: CalibrationState { source, crc: crc_of(bytes) },
        machine: Machine { name, serial },
    })
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
    let default = || default.and_then(|bytes| live(bytes, CalibrationSource::Default));
    match store.read::<StoredCalibration<'_>>().await {
        Ok(None) => Loaded { live: default(), counter: 0, trouble: None },
        Ok(Some(StoredCalibration { counter, record: [] })) => {
            Loaded { live: default(), counter, trouble: None }
        }
        Ok(Some(StoredCalibration { counter, record })) => match live(record, CalibrationSource::Stored) {
            Some(live) => Loaded { live: Some(live), counter, trouble: None },
            None => Loaded { live: default(), counter, trouble: Some(Code::CalibrationLost) },
        },
        Err(StoreError::Schema { .. } | StoreError::Body(_)) => {
            Loaded { live: default(), counter: u32::MAX, trouble: Some(Code::CalibrationLost) }
        }
        Err(_) => Loaded { live: default(), counter: u32::MAX, trouble: Some(Code::StorageFailed) },
    }
}
