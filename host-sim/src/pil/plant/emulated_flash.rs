//! Emulated flash of the controller, whose supply can fail in the middle of a write.
//!
//! The cells outlast the firmware: after a restart they hold what the run before has written. Operations are those of
//! `embedded-storage`: words of 8 bytes, programmed once, and pages of 2 KiB, as on an STM32G474.

use std::future::Future;
use std::pin::pin;
use std::task::{Context, Poll, Waker};

use embedded_storage_async::nor_flash::{NorFlash, ReadNorFlash};
use kou_app::diagnostics::FaultMemory;
use kou_app::storage::{
    CrashReport, HealthRecord, OperatingCounters, RecordKind, Store, StoredCalibration, UpdateCounter,
};
use kou_emulation::RamFlash;
use kou_emulation::ram_flash::Torn;
use kou_emulation::{FLASH_LEN, FLASH_PAGE, FlashDone, FlashWork};

/// Flash cells.
pub type FlashCells = RamFlash<FLASH_LEN, FLASH_PAGE>;

/// Point in a write at which the supply fails.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CutPoint {
    /// Record whose next write is cut.
    pub kind: RecordKind,
    /// Bytes written before the cut, both copies and moved records counted; runs of 64 erased bytes count one.
    pub byte: usize,
    /// Seed of the torn word's content.
    pub seed: u32,
}

/// Result of a flash operation.
#[derive(Debug, Clone, PartialEq, Eq)]
#[allow(clippy::large_enum_variant, reason = "made once in an exchange and passed on at once")]
pub enum FlashOutcome {
    /// An answer for the firmware.
    Answer(FlashDone),
    /// The supply has failed: the firmware is dead.
    NoPower,
}

/// Flash cells and the scheduled power cut.
#[derive(Debug, Clone, Default)]
pub struct EmulatedFlash {
    cells: FlashCells,
    scheduled: Option<CutPoint>,
    /// Cut within the current write.
    armed: Option<CutPoint>,
    /// Record that the last operation was part of.
    record: Option<RecordKind>,
    /// Cells as they were before the write that was cut.
    before: Option<Box<FlashCells>>,
}

/// Stored records; none where never written.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredRecords {
    /// Counter and record of the calibration.
    pub calibration: Option<(u32, Vec<u8>)>,
    /// Counter of the last update, by itself.
    pub counter: Option<u32>,
    /// Learned health.
    pub health: Option<HealthRecord>,
    /// Fault memory.
    pub faults: Option<FaultMemory>,
    /// Hours and starts.
    pub life: Option<OperatingCounters>,
    /// Last crash report.
    pub stop: Option<CrashReport>,
}

/// Value of a future that never waits, since cells in memory are always ready.
fn ready<T>(future: impl Future<Output = T>) -> Option<T> {
    match pin!(future).poll(&mut Context::from_waker(Waker::noop())) {
        Poll::Ready(value) => Some(value),
        Poll::Pending => None,
    }
}

impl StoredRecords {
    /// Reads all records, without changing the cells.
    ///
    /// # Errors
    /// A record that exists and cannot be read.
    pub fn read(cells: &FlashCells) -> Result<Self, String> {
        let mut store = Store::new(cells.clone(), 0..FLASH_LEN as u32).map_err(|e| format!("{e:?}"))?;
        let read = async {
            let calibration = store.read::<StoredCalibration<'_>>().await?;
            let calibration = calibration.map(|stored| (stored.counter, stored.record.to_vec()));
            Ok::<_, kou_app::storage::StoreError>(Self {
                calibration,
                counter: store.read::<UpdateCounter>().await?.map(|read| read.counter),
                health: store.read().await?,
                faults: store.read().await?,
                life: store.read().await?,
                stop: store.read().await?,
            })
        };
        ready(read).ok_or("the flash waits")?.map_err(|error| format!("{error:?}"))
    }
}

impl EmulatedFlash {
    /// Schedules a cut of the supply in the next write of a record.
    pub fn schedule_cut(&mut self, cut: CutPoint) {
        self.scheduled = Some(cut);
    }

    /// Whether a cut is pending.
    #[must_use]
    pub fn is_cut_pending(&self) -> bool {
        self.scheduled.is_some() || self.armed.is_some()
    }

    /// Restores the supply.
    pub fn power_on(&mut self) {
        self.cells.power_on();
        self.armed = None;
        self.record = None;
    }

    /// Present content.
    #[must_use]
    pub fn cells(&self) -> &FlashCells {
        &self.cells
    }

    /// Content before the write that was cut last.
    #[must_use]
    pub fn before_cut(&self) -> Option<&FlashCells> {
        self.before.as_deref()
    }

    /// Notes which record is being written, so that begin and end of a write are known. To be called with every operation and
    /// every millisecond.
    pub fn observe_write(&mut self, record: Option<u8>) {
        let record = record.and_then(RecordKind::from_number);
        let begins = record != self.record;
        if begins && let Some(armed) = self.armed.take() {
            // That write was shorter than the cut point: the next one of its record, then.
            self.cells.power_on();
            self.scheduled = Some(armed);
        }
        self.record = record;
        if let Some(cut) = self.scheduled
            && record == Some(cut.kind)
            && begins
        {
            self.before = Some(Box::new(self.cells.clone()));
            self.cells.cut_after(cut.byte, Torn::Random(cut.seed));
            self.armed = self.scheduled.take();
        }
    }

    /// Executes an operation of the firmware, part of writing `record` if any.
    pub fn execute(&mut self, record: Option<u8>, work: &FlashWork) -> FlashOutcome {
        if !matches!(work, FlashWork::Read { .. }) {
            self.observe_write(record);
        }
        let done = match work {
            FlashWork::Read { offset, length } => {
                let mut bytes = vec![0; usize::from(*length)];
                let read = ready(self.cells.read(*offset, &mut bytes));
                read.and_then(Result::ok).and_then(|()| heapless::Vec::from_slice(&bytes).ok())
            }
            FlashWork::Write { offset, bytes } => {
                ready(self.cells.write(*offset, bytes)).and_then(Result::ok).map(|()| heapless::Vec::new())
            }
            FlashWork::Erase { from, to } => {
                ready(self.cells.erase(*from, *to)).and_then(Result::ok).map(|()| heapless::Vec::new())
            }
        };
        if self.cells.is_dead() { FlashOutcome::NoPower } else { FlashOutcome::Answer(done) }
    }
}
