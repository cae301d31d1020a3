//! Record migration, and the rules of the flash in RAM. Power failures and damaged bits: `tests/e2e/storage.rs`.

use embassy_futures::block_on;
use embedded_storage_async::nor_flash::{NorFlash, ReadNorFlash};
use kou_app::diagnostics::ResetCause;
use kou_app::storage::{
    BUFFER_LEN, MIN_BYTES, OperatingCounters, Record, RecordKind, RegionError, Store, StoreError,
    StoredCalibration,
};
use kou_emulation::RamFlash;
use kou_emulation::ram_flash::{RamFlashError, Torn};
use serde::{Deserialize, Serialize};

const BYTES: usize = MIN_BYTES as usize;
type MinimalFlash = RamFlash<BYTES, 2048>;

fn store() -> Store<MinimalFlash> {
    Store::new(MinimalFlash::new(), 0..MIN_BYTES).unwrap()
}

#[test]
fn unusable_region_is_rejected_by_name() {
    assert_eq!(Store::new(MinimalFlash::new(), 0..MIN_BYTES - 2048).err(), Some(RegionError::TooSmall));
    let odd = Store::new(RamFlash::<{ 2 * BYTES }, 2048>::new(), 8..MIN_BYTES + 8);
    assert_eq!(odd.err(), Some(RegionError::Pages));
    let small = Store::new(RamFlash::<BYTES, 512>::new(), 0..MIN_BYTES);
    assert_eq!(small.err(), Some(RegionError::PageTooSmall));
}

/// Operating counters of a fictitious earlier version.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Older {
    hours: u16,
}

impl Record<'_> for Older {
    const KIND: RecordKind = RecordKind::OperatingCounters;
    const SCHEMA: u16 = 0;
}

/// Operating counters of a fictitious next version.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Newer {
    operating_s: u32,
}

impl<'a> Record<'a> for Newer {
    const KIND: RecordKind = RecordKind::OperatingCounters;
    const SCHEMA: u16 = 2;

    fn migrate(schema: u16, body: &'a [u8]) -> Option<Self> {
        match schema {
            Older::SCHEMA => {
                let older: Older = postcard::from_bytes(body).ok()?;
                Some(Self { operating_s: 3600 * u32::from(older.hours) })
            }
            _ => None,
        }
    }
}

#[test]
fn older_record_is_migrated_and_unsupported_schema_is_rejected_by_name() {
    let mut store = store();
    block_on(async {
        assert_eq!(store.read::<Newer>().await, Ok(None));
        store.write(&Older { hours: 7 }).await.unwrap();
        assert_eq!(store.read::<Newer>().await, Ok(Some(Newer { operating_s: 25_200 })));
        assert_eq!(
            store.read::<OperatingCounters>().await,
            Err(StoreError::Schema { kind: RecordKind::OperatingCounters, found: 0 })
        );
        store.write(&OperatingCounters::new()).await.unwrap();
        assert_eq!(
            store.read::<Newer>().await,
            Err(StoreError::Schema { kind: RecordKind::OperatingCounters, found: 1 })
        );
        // A rejected record can still be replaced.
        store.write(&Newer { operating_s: 1 }).await.unwrap();
        assert_eq!(store.read::<Newer>().await, Ok(Some(Newer { operating_s: 1 })));
    });
}

#[test]
fn record_that_is_too_long_is_rejected_and_the_previous_one_remains() {
    let mut store = store();
    let long = [7; BUFFER_LEN];
    block_on(async {
        let good = StoredCalibration { counter: 1, record: &long[..100] };
        store.write(&good).await.unwrap();
        let wrong = StoredCalibration { counter: 2, record: &long };
        assert_eq!(store.write(&wrong).await, Err(StoreError::TooLong));
        assert_eq!(store.read::<StoredCalibration<'_>>().await, Ok(Some(good)));
        let longest = StoredCalibration {
            counter: u32::MAX,
            record: &long[..kou_estimator::record::calibration::MAX_LEN],
        };
        store.write(&longest).await.unwrap();
        assert_eq!(store.read::<StoredCalibration<'_>>().await, Ok(Some(longest)));
    });
}

#[test]
fn unplanned_resets_are_counted_and_are_faults() {
    let mut life = OperatingCounters::new();
    let unplanned_resets = [ResetCause::BrownOut, ResetCause::Watchdog, ResetCause::Panic];
    for cause in
        [ResetCause::PowerOn, ResetCause::Pin, ResetCause::Software].into_iter().chain(unplanned_resets)
    {
        life.count_start(cause);
        assert_eq!(cause.fault_code().is_some(), unplanned_resets.contains(&cause));
    }
    assert_eq!((life.starts, life.unplanned_resets, life.last_reset), (6, 3, ResetCause::Panic));
    life.add_operating_time(u32::MAX);
    life.add_operating_time(1);
    assert_eq!(life.operating_s, u32::MAX);
}

#[test]
fn flash_in_ram_follows_the_rules_of_nor_flash() {
    let mut flash = MinimalFlash::new();
    block_on(async {
        flash.write(8, &[1; 8]).await.unwrap();
        assert_eq!(flash.write(8, &[1; 8]).await, Err(RamFlashError::NotErased));
        flash.write(8, &[0; 8]).await.unwrap();
        assert_eq!(flash.write(4, &[0; 8]).await, Err(RamFlashError::Unaligned));
        assert_eq!(flash.write(0, &[0; 4]).await, Err(RamFlashError::Unaligned));
        assert_eq!(flash.write(BYTES as u32, &[0; 8]).await, Err(RamFlashError::OutOfBounds));
        assert_eq!(flash.erase(0, 100).await, Err(RamFlashError::Unaligned));
        flash.cut_after(11, Torn::Clean);
        assert_eq!(flash.write(16, &[2; 24]).await, Err(RamFlashError::NoPower));
        assert_eq!(flash.read(0, &mut [0]).await, Err(RamFlashError::NoPower));
        flash.power_on();
        assert_eq!(flash.cells()[16..32], [2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 255, 255, 255, 255, 255]);
        flash.cut_after(1, Torn::Clean);
        assert_eq!(flash.erase(0, 2048).await, Err(RamFlashError::NoPower));
        flash.power_on();
        assert_eq!(flash.cells()[8], 0xFF);
    });
}
