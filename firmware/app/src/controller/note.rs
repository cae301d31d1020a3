//! A note to oneself across a reset, in memory that the start-up code leaves alone: why it came to it.
//!
//! The board sets [`LEN`] bytes aside in a section without initialisation. Before a reset that the firmware causes, or
//! expects, [`write()`] fills them; after the start [`take`] reads them once. Memory after power-on holds anything, so a
//! note is believed only with its mark and its CRC-32.

use core::fmt::{self, Write};

use kou_estimator::calibration::record::crc32;

/// Bytes to set aside.
pub const LEN: usize = 160;

const MARK: [u8; 4] = *b"KOUN";
/// Offset of the text: mark, CRC, kind, length of the text.
const HEAD: usize = 10;

/// What happened.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Kind {
    /// The firmware panicked; the text is its message.
    Panic,
    /// A hard fault; the text tells where.
    HardFault,
    /// A task was overdue; the text is its name.
    Overdue,
    /// A reset that was asked for.
    Asked,
}

impl Kind {
    const ALL: [Self; 4] = [Self::Panic, Self::HardFault, Self::Overdue, Self::Asked];
}

/// Why the controller started, as its hardware tells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ResetCause {
    /// Power came.
    PowerOn,
    /// The supply fell too low and came back.
    BrownOut,
    /// The reset pin.
    Pin,
    /// The watchdog.
    Watchdog,
    /// The firmware itself.
    Software,
    /// None of these, or the hardware does not tell.
    Unknown,
}

/// A note that was left.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Note {
    /// What happened.
    pub kind: Kind,
    /// In words, cut where there was no room.
    pub text: heapless::String<{ LEN - HEAD }>,
}

/// Leaves a note. Longer texts are cut at a whole character.
// Not inlined: formatting has no bound of stack that can be proven, and what comes after a note is a reset.
#[inline(never)]
pub fn write(memory: &mut [u8; LEN], kind: Kind, text: impl fmt::Display) {
    memory.fill(0);
    let (head, body) = memory.split_at_mut(HEAD);
    let mut cut = Cut { body, used: 0 };
    // Writing ends early where there is no more room: that is the cut.
    write!(cut, "{text}").ok();
    let used = u8::try_from(cut.used).unwrap_or(0);
    let kind = Kind::ALL.iter().position(|one| *one == kind).and_then(|i| u8::try_from(i).ok());
    if let [.., kind_byte, length] = head {
        (*kind_byte, *length) = (kind.unwrap_or(0), used);
    }
    let (head, rest) = memory.split_at_mut(8);
    let crc = crc32(rest).to_le_bytes();
    for (byte, value) in head.iter_mut().zip(MARK.into_iter().chain(crc)) {
        *byte = value;
    }
}

/// Reads the note, if there is one, and wipes it.
pub fn take(memory: &mut [u8; LEN]) -> Option<Note> {
    let note = read(memory);
    memory.fill(0);
    note
}

fn read(memory: &[u8; LEN]) -> Option<Note> {
    let (mark, rest) = memory.split_first_chunk::<4>()?;
    let (crc, rest) = rest.split_first_chunk::<4>()?;
    if *mark != MARK || u32::from_le_bytes(*crc) != crc32(rest) {
        return None;
    }
    let (&[kind, length], body) = rest.split_first_chunk::<2>()?;
    let text = core::str::from_utf8(body.get(..usize::from(length))?).ok()?;
    Some(Note { kind: *Kind::ALL.get(usize::from(kind))?, text: heapless::String::try_from(text).ok()? })
}

struct Cut<'a> {
    body: &'a mut [u8],
    used: usize,
}

impl Write for Cut<'_> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for character in text.chars() {
            let mut bytes = [0; 4];
            let bytes = character.encode_utf8(&mut bytes).as_bytes();
            let end = self.used.saturating_add(bytes.len());
            let Some(room) = self.body.get_mut(self.used..end) else { return Err(fmt::Error) };
            room.copy_from_slice(bytes);
            self.used = end;
        }
        Ok(())
    }
}
