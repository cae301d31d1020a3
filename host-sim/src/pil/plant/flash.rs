//! The controller's flash, and the supply that fails in the middle of a write to it.
//!
//! The cells outlast the firmware: a restart finds what the run before has written. Operations come at the level of
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

/// Its cells.
pub type Cells = RamFlash<FLASH_LEN, FLASH_PAGE>;

/// Where the supply is to fail.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Aim {
    /// In the next write of this record.
    pub kind: RecordKind,
    /// After this many bytes of it, both copies and what moves for them counted; stretches of 64 erased bytes count one.
    pub byte: usize,
    /// Of what the word under way is left with.
    pub seed: u32,
}

/// What came of an operation.
#[derive(Debug, Clone, PartialEq, Eq)]
#[allow(clippy::large_enum_variant, reason = "made once in an exchange and passed on at once")]
pub enum Done {
    /// An answer for the firmware.
    Answer(FlashDone),
    /// The supply has failed: there is no firmware any more.
    NoPower,
}

/// The flash.
#[derive(Debug, Clone, Default)]
pub struct Flash {
    cells: Cells,
    aim: Option<Aim>,
    /// The aim of the write under way.
    armed: Option<Aim>,
    /// The record that was being written by the last operation.
    of: Option<RecordKind>,
    /// Cells as they were before the write that was cut.
    before: Option<Box<Cells>>,
}

/// What the records say; each is nothing where it was never written.
#[derive(Debug, Clone, PartialEq)]
pub struct Kept {
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
    /// The last note.
    pub stop: Option<CrashReport>,
}

/// The value of a future that never waits: cells in memory are always ready.
fn ready<T>(future: impl Future<Output = T>) -> Option<T> {
    match pin!(future).poll(&mut Context::from_waker(Waker::noop())) {
        Poll::Ready(value) => Some(value),
        Poll::Pending => None,
    }
}

impl Kept {
    /// Reads what the cells hold, without changing them.
    ///
    /// # Errors
    /// The record that is there and cannot be read.
    pub fn of(cells: &Cells) -> Result<Self, String> {
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

impl Flash {
    /// Cuts the supply in the next write of a record.
    pub fn aim(&mut self, aim: Aim) {
        self.aim = Some(aim);
    }

    /// Whether a cut is still to come.
    #[must_use]
    pub fn is_aimed(&self) -> bool {
        self.aim.is_some() || self.armed.is_some()
    }

    /// The supply is back.
    pub fn power_on(&mut self) {
        self.cells.power_on();
        self.armed = None;
        self.of = None;
    }

    /// What the cells hold now.
    #[must_use]
    pub fn cells(&self) -> &Cells {
        &self.cells
    }

    /// What the cells held before the write that was cut last.
    #[must_use]
    pub fn before_cut(&self) -> Option<&Cells> {
        self.before.as_deref()
    }

    /// Told of every write and in every millisecond which record is being written, so that where a write begins and ends is
    /// known.
    pub fn writes(&mut self, of: Option<u8>) {
        let of = of.and_then(RecordKind::from_number);
        let begins = of != self.of;
        if begins && let Some(armed) = self.armed.take() {
            // That write was shorter than the place aimed at: the next one of its record, then.
            self.cells.power_on();
            self.aim = Some(armed);
        }
        self.of = of;
        if let Some(aim) = self.aim
            && of == Some(aim.kind)
            && begins
        {
            self.before = Some(Box::new(self.cells.clone()));
            self.cells.cut_after(aim.byte, Torn::Random(aim.seed));
            self.armed = self.aim.take();
        }
    }

    /// Does what the firmware asks, `of` a record that it is writing.
    pub fn work(&mut self, of: Option<u8>, work: &FlashWork) -> Done {
        if !matches!(work, FlashWork::Read { .. }) {
            self.writes(of);
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
        if self.cells.is_dead() { Done::NoPower } else { Done::Answer(done) }
    }
}
