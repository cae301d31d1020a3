//! The interrupt vectors of AN386, of which time driver and UART use three, and the controller's executors four.

use cortex_m::interrupt::InterruptNumber;
use cortex_m::peripheral::NVIC;

use crate::priority::{on_high, on_highest, on_low, on_lowest};
use crate::time::{on_alarm, on_wrap};
use crate::uart::on_receive;

/// Interrupts in use, by their numbers in Arm's application note AN386.
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

#[allow(unsafe_code, reason = "cortex-m-rt's handler for interrupts without one")]
unsafe extern "C" {
    fn DefaultHandler();
}

#[allow(unsafe_code, reason = "the vector table is found by name and section")]
#[unsafe(link_section = ".vector_table.interrupts")]
#[unsafe(no_mangle)]
static __INTERRUPTS: [unsafe extern "C" fn(); 32] = {
    let mut table: [unsafe extern "C" fn(); 32] = [DefaultHandler; 32];
    let [
        uart0_receive,
        _,
        _,
        _,
        _,
        _,
        _,
        _,
        timer0,
        timer1,
        _,
        _,
        _,
        _,
        _,
        _,
        _,
        _,
        _,
        _,
        highest,
        high,
        low,
        lowest,
        ..,
    ] = &mut table;
    *uart0_receive = on_receive;
    *timer0 = on_wrap;
    *timer1 = on_alarm;
    *highest = on_highest;
    *high = on_high;
    *low = on_low;
    *lowest = on_lowest;
    table
};
