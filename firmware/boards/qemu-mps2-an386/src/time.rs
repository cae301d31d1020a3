//! Time driver: timer 0 is a free-running counter, timer 1 the alarm of the next sleeping task.
//!
//! Both are 32-bit down-counters at the processor's clock. Timer 0 wraps every 172 s; its interrupt counts the wraps.

use core::cell::RefCell;
use core::sync::atomic::{AtomicU32, Ordering};
use core::task::Waker;

use critical_section::{CriticalSection, Mutex};
use embassy_time_driver::Driver;
use embassy_time_queue_utils::Queue;

use crate::interrupts::{Interrupt, unmask};
use crate::registers::{read, write};

/// Counts of the processor's clock per microsecond.
const COUNTS_PER_US: u64 = 25;

const TIMER0: usize = 0x4000_0000;
const TIMER1: usize = 0x4000_1000;
/// Offsets of a CMSDK timer's registers.
const CTRL: usize = 0x0;
const VALUE: usize = 0x4;
const RELOAD: usize = 0x8;
const INTERRUPT: usize = 0xC;
/// Bits of CTRL.
const ENABLE: u32 = 1 << 0;
const INTERRUPT_ENABLE: u32 = 1 << 3;

struct CmsdkTimers {
    wraps: AtomicU32,
    queue: Mutex<RefCell<Queue>>,
}

embassy_time_driver::time_driver_impl!(static DRIVER: CmsdkTimers = CmsdkTimers {
    wraps: AtomicU32::new(0),
    queue: Mutex::new(RefCell::new(Queue::new())),
});

impl CmsdkTimers {
    /// Sets the alarm of timer 1; returns false when `at` is past.
    fn ring_at(&self, at: u64) -> bool {
        write(TIMER1 + CTRL, 0);
        write(TIMER1 + INTERRUPT, 1);
        if at == u64::MAX {
            return true;
        }
        let Some(delay_us) = at.checked_sub(self.now()).filter(|&delay| delay > 0) else { return false };
        // A delay beyond the counter's range rings early, finds nothing due, and is set again.
        let counts = u32::try_from(delay_us.saturating_mul(COUNTS_PER_US)).unwrap_or(u32::MAX);
        write(TIMER1 + RELOAD, counts);
        write(TIMER1 + VALUE, counts);
        write(TIMER1 + CTRL, ENABLE | INTERRUPT_ENABLE);
        true
    }

    /// Wakes due tasks and sets timer 1 for the next one.
    fn serve(&self, cs: CriticalSection<'_>) {
        let mut queue = self.queue.borrow(cs).borrow_mut();
        let mut next = queue.next_expiration(self.now());
        while !self.ring_at(next) {
            next = queue.next_expiration(self.now());
        }
    }
}

impl Driver for CmsdkTimers {
    fn now(&self) -> u64 {
        if read(TIMER0 + CTRL) & ENABLE == 0 {
            return 0;
        }
        let (wraps, value) = critical_section::with(|_| {
            let value = read(TIMER0 + VALUE);
            let wraps = self.wraps.load(Ordering::Relaxed);
            if read(TIMER0 + INTERRUPT) == 0 {
                (wraps, value)
            } else {
                // Wrapped, and the interrupt waits for this critical section: the value may be of either side.
                (wraps.wrapping_add(1), read(TIMER0 + VALUE))
            }
        });
        ((u64::from(wraps) << 32) | u64::from(u32::MAX - value)) / COUNTS_PER_US
    }

    fn schedule_wake(&self, at: u64, waker: &Waker) {
        critical_section::with(|cs| {
            if self.queue.borrow(cs).borrow_mut().schedule_wake(at, waker) {
                self.serve(cs);
            }
        });
    }
}

/// Starts the count, and the interrupts of both timers.
pub(crate) fn init() {
    write(TIMER0 + RELOAD, u32::MAX);
    write(TIMER0 + VALUE, u32::MAX);
    write(TIMER0 + CTRL, ENABLE | INTERRUPT_ENABLE);
    unmask(Interrupt::Timer0);
    unmask(Interrupt::Timer1);
}

/// Interrupt of timer 0.
pub(crate) extern "C" fn on_wrap() {
    critical_section::with(|_| {
        write(TIMER0 + INTERRUPT, 1);
        DRIVER.wraps.store(DRIVER.wraps.load(Ordering::Relaxed).wrapping_add(1), Ordering::Relaxed);
    });
}

/// Interrupt of timer 1.
pub(crate) extern "C" fn on_alarm() {
    critical_section::with(|cs| DRIVER.serve(cs));
}
