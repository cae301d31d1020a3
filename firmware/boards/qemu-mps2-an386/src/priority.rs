//! Executors of four priorities, each preempting the tasks of the lower ones.
//!
//! The thread is idle. (Its own executor would wait for events, and each wait is expensive in QEMU.) Each executor
//! runs in the interrupt of an unused peripheral, which it pends itself. The timers' interrupts have a higher
//! priority than all of them, or no task would be woken while another one runs.

use embassy_executor::{InterruptExecutor, SendSpawner};

use crate::interrupts::Interrupt;
use crate::registers::write;

/// Priorities of interrupts 20 to 23, one byte each; smaller is higher, and the timers' is 0.
const PRIORITIES_OF_20: usize = 0xE000_E414;
const HIGHEST_PRIORITY: u32 = 0x40;
const HIGH_PRIORITY: u32 = 0x80;
const LOW_PRIORITY: u32 = 0xC0;
const LOWEST_PRIORITY: u32 = 0xE0;

static HIGHEST: InterruptExecutor = InterruptExecutor::new();
static HIGH: InterruptExecutor = InterruptExecutor::new();
static LOW: InterruptExecutor = InterruptExecutor::new();
static LOWEST: InterruptExecutor = InterruptExecutor::new();

/// Starts the executors, once. Returns the spawners of the highest, high, low and lowest priority.
pub fn start() -> [SendSpawner; 4] {
    let priorities = HIGHEST_PRIORITY | HIGH_PRIORITY << 8 | LOW_PRIORITY << 16 | LOWEST_PRIORITY << 24;
    write(PRIORITIES_OF_20, priorities);
    [
        HIGHEST.start(Interrupt::Highest),
        HIGH.start(Interrupt::High),
        LOW.start(Interrupt::Low),
        LOWEST.start(Interrupt::Lowest),
    ]
}

#[allow(unsafe_code, reason = "an executor may only be polled from its interrupt")]
pub(crate) extern "C" fn on_highest() {
    // SAFETY: this is the handler of the interrupt that was given to `HIGHEST.start`.
    unsafe { HIGHEST.on_interrupt() }
}

#[allow(unsafe_code, reason = "an executor may only be polled from its interrupt")]
pub(crate) extern "C" fn on_high() {
    // SAFETY: this is the handler of the interrupt that was given to `HIGH.start`.
    unsafe { HIGH.on_interrupt() }
}

#[allow(unsafe_code, reason = "an executor may only be polled from its interrupt")]
pub(crate) extern "C" fn on_low() {
    // SAFETY: this is the handler of the interrupt that was given to `LOW.start`.
    unsafe { LOW.on_interrupt() }
}

#[allow(unsafe_code, reason = "an executor may only be polled from its interrupt")]
pub(crate) extern "C" fn on_lowest() {
    // SAFETY: this is the handler of the interrupt that was given to `LOWEST.start`.
    unsafe { LOWEST.on_interrupt() }
}
