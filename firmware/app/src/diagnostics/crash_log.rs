//! Crash record that survives a reset, in memory that the start-up code does not initialise.
//!
//! The board reserves [`LEN`] bytes in a section without initialisation. Before a reset that the firmware causes or
//! expects, [`write()`] fills them; after start [`take`] reads them once. Memory after power-on holds arbitrary
//! bytes, so a record is valid only with its magic number and CRC-32. Without a record the memory holds the magic
//! number of running firmware: if that is still present after a reset, the memory has not lost its supply.

use core::fmt;

use kou_estimator::record::crc32;
use serde::{Deserialize, Serialize};

use super::reset_cause::ResetCause;

/// Bytes to reserve.
pub const LEN: usize = 160;

const MARK: [u8; 4] = *b"KOUN";
/// Magic number of running firmware; the rest of the memory is zero.
const RUNS: [u8; 4] = *b"KOUA";
/// Offset of the text, behind magic number, CRC, kind and length of the text.
const HEAD: usize = 10;

/// Kind of a crash.
///
/// On flash by position: append only.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum CrashKind {
    /// Panic; the text is its message.
    Panic,
    /// Hard fault; the text states the location.
    HardFault,
    /// Overdue task; the text is its name.
    Overdue,
    /// Requested reset.
    Requested,
}

impl CrashKind {
    const ALL: [Self; 4] = [Self::Panic, Self::HardFault, Self::Overdue, Self::Requested];
}

/// Crash record left by the previous run.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct CrashRecord {
    /// Kind of the crash.
    pub kind: CrashKind,
    /// Description, truncated to the available room.
    pub text: heapless::String<{ LEN - HEAD }>,
}

/// Cause of the reset: that of the crash record if there is one, because the hardware reports a panic as a software
/// reset; else that of the hardware.
#[must_use]
pub fn reset_cause(hardware: ResetCause, record: Option<&CrashRecord>) -> ResetCause {
    match record.map(|record| record.kind) {
        Some(CrashKind::Panic | CrashKind::HardFault) => ResetCause::Panic,
        Some(CrashKind::Overdue) => ResetCause::Watchdog,
        Some(CrashKind::Requested) => ResetCause::Software,
        None => hardware,
    }
}

/// Writes a crash record; `describe` supplies the text.
// Not inlined: the stack analysis identifies it by name, because only a reset follows.
#[inline(never)]
pub fn write(memory: &mut [u8; LEN], kind: CrashKind, describe: impl FnOnce(&mut CrashText<'_>)) {
    memory.fill(0);
    let (head, body) = memory.split_at_mut(HEAD);
    let mut text = CrashText { body, used: 0 };
    describe(&mut text);
    let used = u8::try_from(text.used).unwrap_or(0);
    let kind = CrashKind::ALL.iter().position(|one| *one == kind).and_then(|i| u8::try_from(i).ok());
    if let [.., kind_byte, length] = head {
        (*kind_byte, *length) = (kind.unwrap_or(0), used);
    }
    let (head, rest) = memory.split_at_mut(8);
    let crc = crc32(rest).to_le_bytes();
    for (byte, value) in head.iter_mut().zip(MARK.into_iter().chain(crc)) {
        *byte = value;
    }
}

/// Reads and erases the crash record, and marks the memory as that of running firmware.
pub fn take(memory: &mut [u8; LEN]) -> Option<CrashRecord> {
    let record = read(memory);
    memory.fill(0);
    for (byte, mark) in memory.iter_mut().zip(RUNS) {
        *byte = mark;
    }
    record
}

/// Whether the memory has retained its content since the previous run; to be called before [`take`].
#[must_use]
pub fn has_survived(memory: &[u8; LEN]) -> bool {
    let runs = memory.split_first_chunk::<4>();
    runs.is_some_and(|(mark, rest)| *mark == RUNS && rest.iter().all(|byte| *byte == 0))
        || read(memory).is_some()
}

/// Cause of a reset by low supply. The hardware reports power-on and a short brown-out alike, but memory without
/// supply loses its content within about a second.
#[must_use]
pub const fn supply_reset(has_survived: bool) -> ResetCause {
    if has_survived { ResetCause::BrownOut } else { ResetCause::PowerOn }
}

fn read(memory: &[u8; LEN]) -> Option<CrashRecord> {
    let (mark, rest) = memory.split_first_chunk::<4>()?;
    let (crc, rest) = rest.split_first_chunk::<4>()?;
    if *mark != MARK || u32::from_le_bytes(*crc) != crc32(rest) {
        return None;
    }
    let (&[kind, length], body) = rest.split_first_chunk::<2>()?;
    let text = core::str::from_utf8(body.get(..usize::from(length))?).ok()?;
    Some(CrashRecord {
        kind: *CrashKind::ALL.get(usize::from(kind))?,
        text: heapless::String::try_from(text).ok()?,
    })
}

/// Text of a crash record, truncated at a character boundary. It implements [`fmt::Write`], but formatting takes
/// kilobytes of flash.
#[derive(Debug)]
pub struct CrashText<'a> {
    body: &'a mut [u8],
    used: usize,
}

impl CrashText<'_> {
    /// Appends a text.
    pub fn push(&mut self, text: &str) -> &mut Self {
        for character in text.chars() {
            let mut bytes = [0; 4];
            let bytes = character.encode_utf8(&mut bytes).as_bytes();
            let end = self.used.saturating_add(bytes.len());
            let Some(room) = self.body.get_mut(self.used..end) else {
                // Append nothing behind a truncation: it would seem to continue the text before it.
                self.body = &mut [];
                break;
            };
            room.copy_from_slice(bytes);
            self.used = end;
        }
        self
    }

    /// Appends eight hexadecimal digits.
    pub fn push_hex(&mut self, number: u32) -> &mut Self {
        for place in (0..8).rev() {
            let digit = (number >> (4 * place)) & 0xF;
            let digit = char::from_digit(digit, 16).unwrap_or('?');
            self.push(digit.encode_utf8(&mut [0; 4]));
        }
        self
    }
}

impl fmt::Write for CrashText<'_> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.push(text);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::prelude::v1::*;

    use proptest::prelude::*;

    use super::*;

    #[test]
    fn crash_record_survives_and_is_read_once() {
        let mut memory = [0xA5; LEN];
        for kind in [CrashKind::Panic, CrashKind::HardFault, CrashKind::Overdue, CrashKind::Requested] {
            write(&mut memory, kind, |text| {
                text.push("index out of bounds at src/x.rs:12");
            });
            let record = take(&mut memory).unwrap();
            assert_eq!((record.kind, record.text.as_str()), (kind, "index out of bounds at src/x.rs:12"));
            assert_eq!(take(&mut memory), None);
        }
        // Too long: truncated, and not within a character.
        let long = ["y", &"ü".repeat(200)].concat();
        write(&mut memory, CrashKind::Panic, |text| {
            text.push(&long).push("x");
        });
        let record = take(&mut memory).unwrap();
        assert!(record.text.len() >= LEN - 12 && long.starts_with(record.text.as_str()), "{}", record.text);
    }

    #[test]
    fn brown_out_is_distinguished_from_power_on() {
        let mut memory = [0xA5; LEN];
        assert_eq!(supply_reset(has_survived(&memory)), ResetCause::PowerOn);
        assert_eq!(take(&mut memory), None);
        // Running firmware that is reset without a record.
        assert_eq!(supply_reset(has_survived(&memory)), ResetCause::BrownOut);
        for bit in 0..LEN * 8 {
            let mut forgetting = memory;
            forgetting[bit / 8] ^= 1 << (bit % 8);
            assert!(!has_survived(&forgetting), "bit {bit}");
        }
        write(&mut memory, CrashKind::Panic, |_| ());
        assert!(has_survived(&memory), "a crash record has survived as well");
    }

    #[test]
    fn every_single_wrong_bit_is_detected() {
        let mut memory = [0; LEN];
        write(&mut memory, CrashKind::Overdue, |text| {
            text.push("estimate");
        });
        for bit in 0..LEN * 8 {
            let mut damaged = memory;
            damaged[bit / 8] ^= 1 << (bit % 8);
            assert_eq!(take(&mut damaged), None, "bit {bit}");
        }
    }

    proptest! {
        #[test]
        fn prop_memory_after_power_on_holds_no_record(bytes in prop::collection::vec(any::<u8>(), LEN)) {
            let mut memory = [0; LEN];
            memory.copy_from_slice(&bytes);
            prop_assert!(!has_survived(&memory));
            prop_assert_eq!(take(&mut memory), None);
        }
    }
}
