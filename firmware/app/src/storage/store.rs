//! Records in flash, each in two copies.
//!
//! sequential-storage appends items and moves the live ones on before it erases a page. It finds a damaged item by its
//! CRC, and then would give the item before it: an older record, with no word. So every record is written twice, with a
//! sequence number: the newer copy is the record, and [`Store::repair`] writes a copy that is damaged, missing or older
//! anew from the other one.
//!
//! No cache is kept: what is in RAM cannot disagree with the flash, and dropping the store costs nothing.

use core::ops::Range;

use embedded_storage_async::nor_flash::NorFlash;
use kou_estimator::calibration::record::MAX_LEN;
use sequential_storage::Error as FlashError;
use sequential_storage::cache::{Cache, Uncached};
use sequential_storage::map::{MapConfig, MapStorage};

use crate::log::warning;
use crate::outlined_await::await_outlined;

use super::framing::{
    DecodeError, Fields, HEAD, OutgoingFrame, Record, RecordCopy, RecordKind, StoredFrame, TAIL, WriteBody,
};

/// Bytes that hold any record with its frame and key: the calibration's, with counter (5) and length (3), is the longest.
pub const BUFFER_LEN: usize = (1 + HEAD + 8 + MAX_LEN + TAIL).next_multiple_of(32);
/// Smallest flash region: all records twice, what pages leave unused, and the page that is empty in turn.
pub const MIN_BYTES: u32 = 16 * 1024;

/// How often a write is tried. A bit that is damaged where nothing was written yet makes the flash refuse to program its
/// word; the library steps over what that leaves behind, so the next attempt goes elsewhere.
const ATTEMPTS: u8 = 3;

/// Why a region of flash cannot be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum RegionError {
    /// Begin or end of the region is not that of a page, or a page or a word has a size that cannot be used.
    Pages,
    /// The region is smaller than [`MIN_BYTES`].
    TooSmall,
    /// A page is too small for the longest record.
    PageTooSmall,
}

/// Why a record is not read or written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum StoreError {
    /// The flash driver refused.
    Flash,
    /// There is no room: the region is too small, or worn out.
    Full,
    /// The region is beyond repair; [`Store::erase`] makes it usable and loses everything in it.
    Corrupted,
    /// The record is longer than [`BUFFER_LEN`] allows.
    TooLong,
    /// The record was written by a version whose schema this one does not read.
    Schema {
        /// Which record.
        kind: RecordKind,
        /// Its schema.
        found: u16,
    },
    /// The record is whole, but not what its kind and schema say.
    Body(RecordKind),
}

impl<E> From<FlashError<E>> for StoreError {
    fn from(error: FlashError<E>) -> Self {
        match error {
            FlashError::Storage { .. } => Self::Flash,
            FlashError::FullStorage => Self::Full,
            FlashError::BufferTooBig
            | FlashError::BufferTooSmall(_)
            | FlashError::SerializationError(_)
            | FlashError::ItemTooBig => Self::TooLong,
            // What the library may add is not known here, and is not repaired here.
            _ => Self::Corrupted,
        }
    }
}

/// What [`Store::repair`] did.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct RepairReport {
    /// Copies that were written anew.
    pub copies: u8,
}

/// Working memory; aligned because some flash drivers copy by words.
#[repr(align(32))]
struct Buffer([u8; BUFFER_LEN]);

/// The records in one region of flash.
pub struct Store<F: NorFlash> {
    map: MapStorage<u8, F, Cache<Uncached, Uncached, Uncached, u8>>,
    buffer: Buffer,
}

/// The record, or why it is none.
fn decoded<'a, R: Record<'a>>(raw: StoredFrame<'a>) -> Result<R, StoreError> {
    raw.decode().map_err(|error| match error {
        DecodeError::Schema(found) => StoreError::Schema { kind: R::KIND, found },
        DecodeError::Body => StoreError::Body(R::KIND),
    })
}

/// What becomes of a record when it is shown. Not inlined, or the record would lie in a task's memory for good.
#[inline(never)]
fn decode_and_apply<'a, R: Record<'a>, T>(
    raw: StoredFrame<'a>,
    take: impl FnOnce(&mut R) -> T,
) -> Result<T, StoreError> {
    // By reference, since every copy of it is most of a kilobyte.
    let mut decoded = decoded(raw);
    match &mut decoded {
        Ok(record) => Ok(take(record)),
        Err(error) => Err(*error),
    }
}

impl<F: NorFlash> Store<F> {
    /// Takes a region of a flash; its content, if any, is that of an earlier run.
    ///
    /// # Errors
    /// When the region cannot be used.
    pub fn new(flash: F, region: Range<u32>) -> Result<Self, RegionError> {
        if region.end.saturating_sub(region.start) < MIN_BYTES {
            return Err(RegionError::TooSmall);
        }
        // Two page marks and the item's head, each a word of at most 32 bytes.
        if F::ERASE_SIZE < BUFFER_LEN.saturating_add(96) {
            return Err(RegionError::PageTooSmall);
        }
        let config = MapConfig::try_new(region).map_err(|_| RegionError::Pages)?;
        Ok(Self {
            map: MapStorage::new(flash, config, Cache::new_uncached()),
            buffer: Buffer([0; BUFFER_LEN]),
        })
    }

    /// The flash, for a driver that has more to tell. Writing to the region through it destroys records.
    pub fn flash(&mut self) -> &mut F {
        self.map.flash()
    }

    /// Gives the flash back.
    pub fn into_flash(self) -> F {
        self.map.destroy().0
    }

    /// The newest record of its kind; nothing where none was ever written, or both copies are damaged.
    ///
    /// # Errors
    /// When the flash cannot be read, or the record is of a schema that is neither this version's nor migrated.
    pub async fn read<'a, R: Record<'a>>(&'a mut self) -> Result<Option<R>, StoreError> {
        let Some(raw) = await_outlined!(self.newest_valid(R::KIND))? else { return Ok(None) };
        decoded(raw).map(Some)
    }

    /// The same; the record is shown to `take`, where it is too large to lie in a task's memory.
    ///
    /// # Errors
    /// As of [`read`](Self::read).
    pub async fn read_to<'a, R: Record<'a>, T>(
        &'a mut self,
        take: impl FnOnce(&mut R) -> T,
    ) -> Result<Option<T>, StoreError> {
        let Some(raw) = await_outlined!(self.newest_valid(R::KIND))? else { return Ok(None) };
        decode_and_apply(raw, take).map(Some)
    }

    /// Body of the newest record of a kind, of whatever schema, as it was written; nothing as of [`read`](Self::read).
    ///
    /// # Errors
    /// When the flash cannot be read.
    pub async fn read_body(&mut self, kind: RecordKind) -> Result<Option<&[u8]>, StoreError> {
        Ok(await_outlined!(self.newest_valid(kind))?.map(|raw| raw.body))
    }

    /// Writes a record, both copies. To be awaited to its end.
    ///
    /// # Errors
    /// When it does not fit or the flash refuses. What was there before is then still there, or already replaced whole.
    pub async fn write<'a, R: Record<'a>>(&mut self, record: &R) -> Result<(), StoreError> {
        await_outlined!(self.write_both(R::KIND, R::SCHEMA, &Fields(record)))
    }

    /// Writes copies that are damaged, missing or older anew from the newer ones: at every start, and from time to time.
    /// To be awaited to its end. `scratch` needs [`BUFFER_LEN`] bytes.
    ///
    /// # Errors
    /// As [`write`](Self::write).
    pub async fn repair(&mut self, scratch: &mut [u8]) -> Result<RepairReport, StoreError> {
        let mut report = RepairReport::default();
        for kind in RecordKind::ALL {
            let [a, b] = await_outlined!(self.sequences(kind))?;
            let (from, to) = match (a, b) {
                (None, Some(_)) => (RecordCopy::B, RecordCopy::A),
                (Some(_), None) => (RecordCopy::A, RecordCopy::B),
                (Some(a), Some(b)) if a < b => (RecordCopy::B, RecordCopy::A),
                (Some(a), Some(b)) if a > b => (RecordCopy::A, RecordCopy::B),
                _ => continue,
            };
            let key = kind.key(from);
            let raw = self.map.fetch_item::<StoredFrame<'_>>(scratch, &key).await?;
            let raw = raw.and_then(|raw| raw.with_key(key)).ok_or(StoreError::Corrupted)?;
            let StoredFrame { schema, sequence, body, .. } = raw;
            await_outlined!(self.put(&OutgoingFrame { key: kind.key(to), schema, sequence, body: &body }))?;
            report.copies = report.copies.saturating_add(1);
            warning!("copy of record {} written anew", kind);
        }
        Ok(report)
    }

    /// Erases the whole region: every record is lost, the counter against replayed updates too. For the workshop, and for
    /// a region that is [`StoreError::Corrupted`].
    ///
    /// # Errors
    /// When the flash refuses.
    pub async fn erase(&mut self) -> Result<(), StoreError> {
        Ok(self.map.erase_all().await?)
    }

    /// The newest record of a kind, not yet understood.
    async fn newest_valid(&mut self, kind: RecordKind) -> Result<Option<StoredFrame<'_>>, StoreError> {
        let Some((_, newest)) = await_outlined!(self.newest(kind))? else { return Ok(None) };
        let key = kind.key(newest);
        let raw = self.map.fetch_item::<StoredFrame<'_>>(&mut self.buffer.0, &key).await?;
        // It was whole a moment ago; if it is not now, the flash is failing.
        raw.and_then(|raw| raw.with_key(key)).ok_or(StoreError::Corrupted).map(Some)
    }

    /// Writes both copies of a record.
    async fn write_both(
        &mut self,
        kind: RecordKind,
        schema: u16,
        body: &dyn WriteBody,
    ) -> Result<(), StoreError> {
        let newest = await_outlined!(self.newest(kind))?;
        // The copy that is not the newest goes first: until it is whole, the newest is the record.
        let (last, sequence) = newest.map_or((RecordCopy::B, 0), |(sequence, copy)| (copy, sequence));
        let first = if last == RecordCopy::A { RecordCopy::B } else { RecordCopy::A };
        let sequence = sequence.saturating_add(1);
        for copy in [first, last] {
            await_outlined!(self.put(&OutgoingFrame { key: kind.key(copy), schema, sequence, body }))?;
        }
        Ok(())
    }

    /// Writes one copy and looks whether it can be found again: in a region that is damaged beyond single bits the
    /// library may write where it does not look.
    async fn put(&mut self, outgoing: &OutgoingFrame<'_>) -> Result<(), StoreError> {
        let mut result = Err(StoreError::Flash);
        for _ in 0..ATTEMPTS {
            let stored = self.map.store_item(&mut self.buffer.0, &outgoing.key, outgoing).await;
            result = stored.map_err(StoreError::from);
            if result.is_ok() && await_outlined!(self.sequence(outgoing.key))? != Some(outgoing.sequence) {
                result = Err(StoreError::Corrupted);
            }
            if !matches!(result, Err(StoreError::Flash | StoreError::Corrupted)) {
                break;
            }
        }
        result
    }

    /// Sequence number of a copy that is whole.
    async fn sequence(&mut self, key: u8) -> Result<Option<u32>, StoreError> {
        let raw = self.map.fetch_item::<StoredFrame<'_>>(&mut self.buffer.0, &key).await;
        match raw {
            Ok(raw) => Ok(raw.and_then(|raw| raw.with_key(key)).map(|raw| raw.sequence)),
            // No frame, or a damaged one, whatever the library thinks of it.
            Err(FlashError::SerializationError(_)) => Ok(None),
            Err(error) => Err(error.into()),
        }
    }

    /// Sequence numbers of the copies that are whole.
    async fn sequences(&mut self, kind: RecordKind) -> Result<[Option<u32>; 2], StoreError> {
        let mut both = [None; 2];
        for (copy, sequence) in [RecordCopy::A, RecordCopy::B].into_iter().zip(&mut both) {
            *sequence = await_outlined!(self.sequence(kind.key(copy)))?;
        }
        Ok(both)
    }

    /// The newest copy and its sequence number.
    async fn newest(&mut self, kind: RecordKind) -> Result<Option<(u32, RecordCopy)>, StoreError> {
        let [a, b] = await_outlined!(self.sequences(kind))?;
        Ok(match (a, b) {
            (Some(a), Some(b)) if b > a => Some((b, RecordCopy::B)),
            (Some(a), _) => Some((a, RecordCopy::A)),
            (None, Some(b)) => Some((b, RecordCopy::B)),
            (None, None) => None,
        })
    }
}
