//! Interrupt vector table of AN386: three peripherals and four executors.

use crate::priority::{on_high, on_highest, on_low, on_lowest};
use crate::time::{on_alarm, on_wrap};
use crate::uart::on_receive;

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
