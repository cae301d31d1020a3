//! Counts instructions with a timer: under QEMU's `-icount shift=10` every instruction takes 1024 ns.
//!
//! The board's CMSDK timer runs at 25 MHz, so one instruction is 25.6 ticks, and the count is exact as long as the
//! ticks are rounded. What is counted around the function of interest (loading its arguments, the call, storing its
//! result) is measured with an empty function of the same signature in its place and subtracted: the very same machine
//! code makes both calls, because it is handed the function as a pointer that the optimiser cannot see through.

use core::ptr::{read_volatile, write_volatile};

/// CMSDK TIMER0 of mps2-an386.
const TIMER0: *mut u32 = 0x4000_0000 as *mut u32;
/// Word offsets of its registers.
const CTRL: usize = 0;
const VALUE: usize = 1;
const RELOAD: usize = 2;

/// Ten instructions in ticks: 10 x 1024 ns at 40 ns per tick.
const TICKS_PER_TEN: u32 = 256;

/// Starts the timer, counting down from its largest value.
pub fn start() {
    #[allow(unsafe_code, reason = "memory-mapped timer")]
    // SAFETY: mps2-an386 has a CMSDK timer at this address and nothing else in this program uses it.
    unsafe {
        write_volatile(TIMER0.add(RELOAD), u32::MAX);
        write_volatile(TIMER0.add(VALUE), u32::MAX);
        write_volatile(TIMER0.add(CTRL), 1);
    }
}

#[inline(always)]
fn now() -> u32 {
    #[allow(unsafe_code, reason = "memory-mapped timer")]
    // SAFETY: as in `start`; reading the value has no side effect.
    unsafe {
        read_volatile(TIMER0.add(VALUE))
    }
}

/// Ticks that `work` takes, the two readings of the timer included.
#[inline(always)]
pub fn ticks(work: impl FnOnce()) -> u32 {
    let before = now();
    work();
    // The timer counts down.
    before.wrapping_sub(now())
}

/// Instructions in the difference of two counts.
pub fn instructions(ticks: u32, ticks_empty: u32) -> u32 {
    (ticks.saturating_sub(ticks_empty) * 10 + TICKS_PER_TEN / 2) / TICKS_PER_TEN
}
