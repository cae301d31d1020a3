//! Numbers of the interrupts in use, from Arm's application note AN386.

use cortex_m::interrupt::InterruptNumber;
use cortex_m::peripheral::NVIC;

/// Interrupts in use.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Interrupt {
    /// UART 0 has received a byte.
    Uart0Receive = 0,
    /// CMSDK timer 0.
    Timer0 = 8,
    /// CMSDK timer 1.
    Timer1 = 9,
    /// Unused peripheral: executor of the highest priority.
    Highest = 20,
    /// Unused peripheral: executor of high priority.
    High = 21,
    /// Unused peripheral: executor of low priority.
    Low = 22,
    /// Unused peripheral: executor of the lowest priority.
    Lowest = 23,
}

#[allow(unsafe_code, reason = "declares interrupt numbers to cortex-m")]
// SAFETY: the numbers are those of the application note and do not change.
unsafe impl InterruptNumber for Interrupt {
    fn number(self) -> u16 {
        self as u16
    }
}

/// Enables an interrupt.
pub(crate) fn unmask(interrupt: Interrupt) {
    #[allow(unsafe_code, reason = "unmasking an interrupt can break a critical section based on masking")]
    // SAFETY: critical sections on this board disable interrupts altogether and mask none.
    unsafe {
        NVIC::unmask(interrupt);
    }
}
