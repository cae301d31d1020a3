//! Backtrace without unwind tables: return addresses found on the stack, newest first.
//!
//! For boards without flash to spare for panic texts and locations, which take 8 KB, most of it paths of source
//! files. The addresses need no flash and identify the callers as well; `addr2line` translates them into files and
//! lines with the ELF that was flashed (`docs/firmware.md`). Addresses left by functions that have returned may be
//! among them.

use core::ops::Range;

use super::crash_log::CrashText;

/// Number of addresses reported: as many as a [crash record](crate::diagnostics::crash_log) has room for.
const MAX_ADDRESSES: usize = 12;

/// Program memory as the processor sees it, in Thumb code.
pub trait CodeMemory {
    /// Address range of the code.
    fn code(&self) -> Range<u32>;

    /// Halfword at an even address within [`code`](Self::code).
    fn halfword(&self, at: u32) -> u16;
}

/// Return addresses among the words of a stack, newest word first.
pub fn return_addresses(
    program: &impl CodeMemory,
    stack: impl Iterator<Item = u32>,
) -> impl Iterator<Item = u32> {
    stack.filter(|word| is_behind_call(program, *word)).take(MAX_ADDRESSES)
}

/// Whether a word is a Thumb code address preceded by a call instruction: `bl` of two halfwords, or `blx` of a
/// register.
fn is_behind_call(program: &impl CodeMemory, word: u32) -> bool {
    let at = word & !1;
    let (first, second) = (at.wrapping_sub(4), at.wrapping_sub(2));
    let code = program.code();
    // Bit 0 marks Thumb code, the only code that this processor executes.
    if word & 1 == 0 || !code.contains(&first) || !code.contains(&second) {
        return false;
    }
    let (first, second) = (program.halfword(first), program.halfword(second));
    (first & 0xf800 == 0xf000 && second & 0xd000 == 0xd000) || second & 0xff87 == 0x4780
}

/// Writes addresses into a crash record.
pub fn write_backtrace(text: &mut CrashText<'_>, addresses: impl Iterator<Item = u32>) {
    text.push("called from");
    for address in addresses {
        text.push(" ").push_hex(address);
    }
}

#[cfg(test)]
mod tests {
    use super::super::crash_log::{self, CrashKind};
    use super::*;

    /// `bl` at 0x100, `nop`s, `blx r3` at 0x10a, `b.w` at 0x10c.
    struct TestCode;

    const HALFWORDS: [u16; 8] = [0xf000, 0xf87d, 0xbf00, 0xbf00, 0xbf00, 0x4798, 0xf000, 0xb87d];

    impl CodeMemory for TestCode {
        fn code(&self) -> Range<u32> {
            0x100..0x110
        }

        fn halfword(&self, at: u32) -> u16 {
            HALFWORDS[(at as usize - 0x100) / 2]
        }
    }

    #[test]
    fn return_addresses_are_distinguished_from_other_words_on_a_stack() {
        // Behind `bl`, even, behind `nop`, behind `blx`, behind `b.w`, start of the code, beyond its end, data.
        let stack = [0x105, 0x104, 0x107, 0x10d, 0x111, 0x101, 0x103, 0x115, 0, 1, 3, 5, u32::MAX, 0x105];
        let found: std::vec::Vec<u32> = return_addresses(&TestCode, stack.into_iter()).collect();
        assert_eq!(found, [0x105, 0x10d, 0x105]);
        let mut memory = [0; crash_log::LEN];
        crash_log::write(&mut memory, CrashKind::Panic, |text| {
            write_backtrace(text, return_addresses(&TestCode, stack.into_iter()))
        });
        assert_eq!(crash_log::take(&mut memory).unwrap().text, "called from 00000105 0000010d 00000105");
    }

    #[test]
    fn prop_no_word_reads_outside_of_the_code() {
        // `halfword` of this program panics outside of its code.
        for word in (0..0x300).chain(u32::MAX - 8..=u32::MAX) {
            let _ = is_behind_call(&TestCode, word);
        }
        let endless = core::iter::repeat(0x105);
        let mut memory = [0; crash_log::LEN];
        crash_log::write(&mut memory, CrashKind::Panic, |text| {
            write_backtrace(text, return_addresses(&TestCode, endless))
        });
        let text = crash_log::take(&mut memory).unwrap().text;
        assert_eq!(text.split(' ').count(), 2 + MAX_ADDRESSES, "as many as a crash record has room for");
        assert!(text.ends_with(" 00000105"), "{text}");
    }
}
