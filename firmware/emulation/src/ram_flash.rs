//! NOR flash in RAM whose power can fail in the middle of a write or an erasure.
//!
//! A word is programmed once after an erasure, or to zeros at any time, as on the STM32G4. Not modelled: a word whose
//! programming was interrupted can read differently each time, or with an uncorrectable ECC error.

use embedded_storage_async::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};

/// Bytes of a word, which is programmed at once.
pub const WORD: usize = 8;
/// Bytes erased between two points at which the power can fail.
const ERASE_STEP: usize = 64;

/// Content of the word or stretch in progress when the power fails.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Torn {
    /// Completed bytes are new; the others are unchanged.
    #[default]
    Clean,
    /// In addition, some bits of the word or stretch in progress are new and some old, chosen by this seed.
    Random(u32),
}

/// Flash of `BYTES` bytes in pages of `PAGE`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RamFlash<const BYTES: usize, const PAGE: usize> {
    cells: [u8; BYTES],
    /// Bytes to program and stretches to erase before the power fails; `None` for never.
    until_cut: Option<usize>,
    torn: Torn,
    is_dead: bool,
    /// Bytes programmed and stretches erased so far.
    worked: usize,
    erasures: usize,
}

/// Reason why an operation failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum RamFlashError {
    /// Not aligned to words or pages.
    Unaligned,
    /// Beyond the end of the flash.
    OutOfBounds,
    /// A word was programmed a second time.
    NotErased,
    /// The power has failed.
    NoPower,
}

impl NorFlashError for RamFlashError {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::Unaligned => NorFlashErrorKind::NotAligned,
            Self::OutOfBounds => NorFlashErrorKind::OutOfBounds,
            Self::NotErased | Self::NoPower => NorFlashErrorKind::Other,
        }
    }
}

impl<const BYTES: usize, const PAGE: usize> Default for RamFlash<BYTES, PAGE> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const BYTES: usize, const PAGE: usize> RamFlash<BYTES, PAGE> {
    /// Erased flash.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            cells: [0xFF; BYTES],
            until_cut: None,
            torn: Torn::Clean,
            is_dead: false,
            worked: 0,
            erasures: 0,
        }
    }

    /// Makes the power fail after this many more programmed bytes and erased stretches of 64 bytes.
    pub fn cut_after(&mut self, bytes: usize, torn: Torn) {
        self.until_cut = Some(bytes);
        self.torn = torn;
    }

    /// Restores the power permanently.
    pub fn power_on(&mut self) {
        self.until_cut = None;
        self.is_dead = false;
    }

    /// Whether the power has failed.
    #[must_use]
    pub fn is_dead(&self) -> bool {
        self.is_dead
    }

    /// Number of pages erased so far.
    #[must_use]
    pub fn erasures(&self) -> usize {
        self.erasures
    }

    /// Bytes programmed and stretches of 64 bytes erased so far: the number of points at which the power can fail.
    #[must_use]
    pub fn worked(&self) -> usize {
        self.worked
    }

    /// Every cell, for tests that damage them.
    pub fn cells(&mut self) -> &mut [u8; BYTES] {
        &mut self.cells
    }

    /// Amount of an operation that completes; the power fails when that is not all.
    fn spend(&mut self, wanted: usize) -> usize {
        let done = match &mut self.until_cut {
            None => wanted,
            Some(left) => {
                let done = wanted.min(*left);
                *left = left.saturating_sub(done);
                self.is_dead = done < wanted;
                done
            }
        };
        self.worked = self.worked.saturating_add(done);
        done
    }

    fn range(offset: u32, len: usize) -> Option<core::ops::Range<usize>> {
        let start = usize::try_from(offset).ok()?;
        let end = start.checked_add(len)?;
        (end <= BYTES).then_some(start..end)
    }
}

/// Byte in which some bits have changed from `old` to `new`.
fn half_way(old: u8, new: u8, seed: u32, place: usize) -> u8 {
    let mixed = (seed ^ place as u32).wrapping_mul(0x9E37_79B9);
    let mask = (mixed ^ (mixed >> 15)) as u8;
    (old & mask) | (new & !mask)
}

impl<const BYTES: usize, const PAGE: usize> ErrorType for RamFlash<BYTES, PAGE> {
    type Error = RamFlashError;
}

impl<const BYTES: usize, const PAGE: usize> ReadNorFlash for RamFlash<BYTES, PAGE> {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), RamFlashError> {
        if self.is_dead {
            return Err(RamFlashError::NoPower);
        }
        let range = Self::range(offset, bytes.len()).ok_or(RamFlashError::OutOfBounds)?;
        bytes.copy_from_slice(self.cells.get(range).ok_or(RamFlashError::OutOfBounds)?);
        Ok(())
    }

    fn capacity(&self) -> usize {
        BYTES
    }
}

impl<const BYTES: usize, const PAGE: usize> NorFlash for RamFlash<BYTES, PAGE> {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = PAGE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), RamFlashError> {
        if self.is_dead {
            return Err(RamFlashError::NoPower);
        }
        let len = usize::try_from(to.saturating_sub(from))
            .map_err(|_: core::num::TryFromIntError| RamFlashError::OutOfBounds)?;
        let range = Self::range(from, len).ok_or(RamFlashError::OutOfBounds)?;
        if !range.start.is_multiple_of(PAGE) || !range.end.is_multiple_of(PAGE) {
            return Err(RamFlashError::Unaligned);
        }
        self.erasures = self.erasures.saturating_add(range.len() / PAGE);
        for start in range.step_by(ERASE_STEP) {
            let torn = self.torn;
            let done = self.spend(1) == 1;
            let cells = self.cells.iter_mut().enumerate().skip(start).take(ERASE_STEP);
            for (place, cell) in cells {
                match torn {
                    _ if done => *cell = 0xFF,
                    Torn::Random(seed) => *cell = half_way(*cell, 0xFF, seed, place),
                    Torn::Clean => {}
                }
            }
            if !done {
                return Err(RamFlashError::NoPower);
            }
        }
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), RamFlashError> {
        if self.is_dead {
            return Err(RamFlashError::NoPower);
        }
        let range = Self::range(offset, bytes.len()).ok_or(RamFlashError::OutOfBounds)?;
        if !range.start.is_multiple_of(WORD) || !bytes.len().is_multiple_of(WORD) {
            return Err(RamFlashError::Unaligned);
        }
        let torn = self.torn;
        for (start, word) in range.step_by(WORD).zip(bytes.chunks(WORD)) {
            let cells = self.cells.get(start..start.saturating_add(WORD)).unwrap_or_default();
            if cells.iter().any(|cell| *cell != 0xFF) && word.iter().any(|byte| *byte != 0) {
                return Err(RamFlashError::NotErased);
            }
            let done = self.spend(WORD);
            let cells = self.cells.iter_mut().enumerate().skip(start);
            for (i, ((place, cell), byte)) in cells.zip(word).enumerate() {
                match torn {
                    _ if i < done => *cell = *byte,
                    Torn::Random(seed) => *cell = half_way(*cell, *byte, seed, place),
                    Torn::Clean => {}
                }
            }
            if done < WORD {
                return Err(RamFlashError::NoPower);
            }
        }
        Ok(())
    }
}
