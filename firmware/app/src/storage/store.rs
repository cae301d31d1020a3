//! Redundant record store: each record in flash in two copies.
//!
//! sequential-storage appends items, and moves live items before it erases a page. It detects a damaged item by its
//! CRC and then silently returns the previous item of the same key, an older record. Every record is therefore
//! written twice, with a sequence number: the newer copy is the record, and [`Store::repair`] rewrites a copy that is
//! damaged, missing or older from the other one.
//!
//! There is no cache: RAM cannot disagree with the flash, and dropping the store is free.

use core::ops::Range;

use embedded_storage_async::nor_flash::NorFlash;
use kou_estimator::record::calibration::MAX_LEN;
use sequential_storage::Error as FlashError;
use sequential_storage::cache::{Cache, Uncached};
use sequential_storage::map::{MapConfig, MapStorage};

use crate::log::warning;
use crate::outlined_await::await_outlined;

use super::framing::{
    DecodeError, Fields, HEAD, OutgoingFrame, Record, RecordCopy, RecordKind, StoredFrame, TAIL, WriteBody,
};

/// Buffer size for any record with frame and key; the longest is the calibration with counter (5) and length (3).
pub const BUFFER_LEN: usize = (1 + HEAD + 8 + MAX_LEN + TAIL).next_multiple_of(32);
/// Smallest flash region: every record twice, unused space at page ends, and one empty page for rotation.
pub const MIN_BYTES: u32 = 16 * 1024;

/// Attempts per write. A bit damaged in erased flash prevents its word from being programmed; the library skips the
/// word, so the next attempt uses another place.
const ATTEMPTS: u8 = 3;

/// Reason why a flash region cannot be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum RegionError {
    /// Region limits are not page limits, or page or word size is unsupported.
    Pages,
    /// Region smaller than [`MIN_BYTES`].
    TooSmall,
    /// Page too small for the longest record.
    PageTooSmall,
}

/// Reason why a record cannot be read or written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum StoreError {
    /// Error of the flash driver.
    Flash,
    /// No room: the region is too small, or worn out.
    Full,
    /// The region is damaged beyond repair; [`Store::erase`] makes it usable and erases every record.
    Corrupted,
    /// Record longer than [`BUFFER_LEN`] allows.
    TooLong,
    /// Record of an unsupported schema.
    Schema {
        /// Kind of the record.
        kind: RecordKind,
        /// Its schema.
        found: u16,
    },
    /// Intact record whose body does not match its kind and schema.
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
            // Errors that the library may add are unknown and not repairable here.
            _ => Self::Corrupted,
        }
    }
}

/// Result of [`Store::repair`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct RepairReport {
    /// Number of rewritten copies.
    pub copies: u8,
}

/// Working memory, aligned because some flash drivers copy by words.
#[repr(align(32))]
struct Buffer([u8; BUFFER_LEN]);

/// Record store in one region of flash.
#[doc(alias = "redundant storage")]
pub struct Store<F: NorFlash> {
    map: MapStorage<u8, F, Cache<Uncached, Uncached, Uncached, u8>>,
    buffer: Buffer,
}

/// Decodes a record.
fn decoded<'a, R: Record<'a>>(raw: StoredFrame<'a>) -> Result<R, StoreError> {
    raw.decode().map_err(|error| match error {
        DecodeError::Schema(found) => StoreError::Schema { kind: R::KIND, found },
        DecodeError::Body => StoreError::Body(R::KIND),
    })
}

/// Applies a function to a decoded record. Not inlined: the record would otherwise occupy a task's memory
/// permanently.
#[inline(never)]
fn decode_and_apply<'a, R: Record<'a>, T>(
    raw: StoredFrame<'a>,
    take: impl FnOnce(&mut R) -> T,
) -> Result<T, StoreError> {
    // By reference: a copy is most of a kilobyte.
    let mut decoded = decoded(raw);
    match &mut decoded {
        Ok(record) => Ok(take(record)),
        Err(error) => Err(*error),
    }
}

impl<F: NorFlash> Store<F> {
    /// Opens a region of flash, whose content is that of an earlier run or erased.
    ///
    /// # Errors
    /// The region cannot be used.
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

    /// Underlying flash driver. Writing to the region through it destroys records.
    pub fn flash(&mut self) -> &mut F {
        self.map.flash()
    }

    /// Releases the flash driver.
    pub fn into_flash(self) -> F {
        self.map.destroy().0
    }

    /// Reads the newest record of its kind; `None` if none was ever written, or both copies are damaged.
    ///
    /// # Errors
    /// The flash cannot be read, or the record's schema is not supported.
    pub async fn read<'a, R: Record<'a>>(&'a mut self) -> Result<Option<R>, StoreError> {
        let Some(raw) = await_outlined!(self.newest_valid(R::KIND))? else { return Ok(None) };
        decoded(raw).map(Some)
    }

    /// Reads a record too large for a task's memory, and passes it to `take`.
    ///
    /// # Errors
    /// Those of [`read`](Self::read).
    pub async fn read_to<'a, R: Record<'a>, T>(
        &'a mut self,
        take: impl FnOnce(&mut R) -> T,
    ) -> Result<Option<T>, StoreError> {
        let Some(raw) = await_outlined!(self.newest_valid(R::KIND))? else { return Ok(None) };
        decode_and_apply(raw, take).map(Some)
    }

    /// Reads the body of the newest record of a kind, of any schema, as it was written; `None` as in
    /// [`read`](Self::read).
    ///
    /// # Errors
    /// The flash cannot be read.
    pub async fn read_body(&mut self, kind: RecordKind) -> Result<Option<&[u8]>, StoreError> {
        Ok(await_outlined!(self.newest_valid(kind))?.map(|raw| raw.body))
    }

    /// Writes both copies of a record. Must be awaited to its end.
    ///
    /// # Errors
    /// The record does not fit, or the flash fails. The previous record then still exists, or is completely replaced.
    pub async fn write<'a, R: Record<'a>>(&mut self, record: &R) -> Result<(), StoreError> {
        await_outlined!(self.write_both(R::KIND, R::SCHEMA, &Fields(record)))
    }

    /// Rewrites copies that are damaged, missing or older from the newer ones: at every start, and occasionally. Must
    /// be awaited to its end. `scratch` needs [`BUFFER_LEN`] bytes.
    ///
    /// # Errors
    /// Those of [`write`](Self::write).
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
            warning!("copy of record {} rewritten", kind);
        }
        Ok(report)
    }

    /// Erases the whole region with every record, including the counter that prevents replayed updates. For the
    /// workshop, and for a region that is [`StoreError::Corrupted`].
    ///
    /// # Errors
    /// The flash fails.
    pub async fn erase(&mut self) -> Result<(), StoreError> {
        Ok(self.map.erase_all().await?)
    }

    /// Newest record of a kind, not yet decoded.
    async fn newest_valid(&mut self, kind: RecordKind) -> Result<Option<StoredFrame<'_>>, StoreError> {
        let Some((_, newest)) = await_outlined!(self.newest(kind))? else { return Ok(None) };
        let key = kind.key(newest);
        let raw = self.map.fetch_item::<StoredFrame<'_>>(&mut self.buffer.0, &key).await?;
        // It was intact a moment ago; if it no longer is, the flash is failing.
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
        // The older copy is overwritten first: the newest remains the record until the new one is complete.
        let (last, sequence) = newest.map_or((RecordCopy::B, 0), |(sequence, copy)| (copy, sequence));
        let first = if last == RecordCopy::A { RecordCopy::B } else { RecordCopy::A };
        let sequence = sequence.saturating_add(1);
        for copy in [first, last] {
            await_outlined!(self.put(&OutgoingFrame { key: kind.key(copy), schema, sequence, body }))?;
        }
        Ok(())
    }

    /// Writes one copy and verifies that it can be found: in a region with more than single damaged bits the library
    /// may write where it does not search.
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

    /// Sequence number of an intact copy.
    async fn sequence(&mut self, key: u8) -> Result<Option<u32>, StoreError> {
        let raw = self.map.fetch_item::<StoredFrame<'_>>(&mut self.buffer.0, &key).await;
        match raw {
            Ok(raw) => Ok(raw.and_then(|raw| raw.with_key(key)).map(|raw| raw.sequence)),
            // No frame, or a damaged one, whatever the library reports.
            Err(FlashError::SerializationError(_)) => Ok(None),
            Err(error) => Err(error.into()),
        }
    }

    /// Sequence numbers of the intact copies.
    async fn sequences(&mut self, kind: RecordKind) -> Result<[Option<u32>; 2], StoreError> {
        let mut both = [None; 2];
        for (copy, sequence) in [RecordCopy::A, RecordCopy::B].into_iter().zip(&mut both) {
            *sequence = await_outlined!(self.sequence(kind.key(copy)))?;
        }
        Ok(both)
    }

    /// Newest copy and its sequence number.
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
