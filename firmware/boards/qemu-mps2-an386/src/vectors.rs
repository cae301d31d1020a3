//! The interrupt vectors of AN386, of which the time driver uses two.

use cortex_m::interrupt::InterruptNumber;

use crate::time::{on_alarm, on_wrap};

/// Interrupts in use, by their numbers in Arm's application note AN386.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Interrupt {
    /// CMSDK timer 0.
    Timer0 = 8,
    /// CMSDK timer 1.
    Timer1 = 9,
}

#[allow(unsafe_code, reason = "declares interrupt numbers to cortex-m")]
// SAFETY: the numbers are those of the application note and do not change.
unsafe impl InterruptNumber for Interrupt {
    fn number(self) -> u16 {
        self as u16
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
    let [_, _, _, _, _, _, _, _, timer0, timer1, ..] = &mut table;
    *timer0 = on_wrap;
    *timer1 = on_alarm;
    table
};
