//! Interrupts in use, by the numbers of Arm's application note AN386.

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
    /// Of no peripheral in use: the executor of the highest priority.
    Highest = 20,
    /// Of no peripheral in use: the executor of high priority.
    High = 21,
    /// Of no peripheral in use: the executor of low priority.
    Low = 22,
    /// Of no peripheral in use: the executor of the lowest priority.
    Lowest = 23,
}

#[allow(unsafe_code, reason = "declares interrupt numbers to cortex-m")]
// SAFETY: the numbers are those of the application note and do not change.
unsafe impl InterruptNumber for Interrupt {
    fn number(self) -> u16 {
        self as u16
    }
}

/// Lets an interrupt through.
pub(crate) fn unmask(interrupt: Interrupt) {
    #[allow(unsafe_code, reason = "unmasking an interrupt can break a critical section based on masking")]
    // SAFETY: critical sections on this board disable interrupts altogether and mask none.
    unsafe {
        NVIC::unmask(interrupt);
    }
}
