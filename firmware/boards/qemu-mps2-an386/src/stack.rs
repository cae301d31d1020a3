//! High-water mark of the stack: start-up paints it, and used words have lost the paint.

use cortex_m_rt::STACK_PAINT_VALUE;

/// Deepest stack since start, in bytes.
///
/// Scans the free memory below the stack: about 5 ms of the board's time, in which no other task runs.
#[allow(unsafe_code, reason = "reads the painted memory between the linker's symbols")]
#[must_use]
pub fn high_water_bytes() -> u32 {
    unsafe extern "C" {
        static _stack_start: u32;
        static _stack_end: u32;
    }
    let (mut word, top) = (&raw const _stack_end, &raw const _stack_start);
    while word < top {
        // SAFETY: the linker script puts both symbols into RAM, aligned to four bytes, `_stack_end` below; what lies
        // between them is the stack, part of no Rust object that this function could alias. Volatile, because part of
        // it is the present call's own frame.
        if unsafe { word.read_volatile() } != STACK_PAINT_VALUE {
            break;
        }
        word = word.wrapping_add(1);
    }
    u32::try_from(top.addr().saturating_sub(word.addr())).unwrap_or(u32::MAX)
}
