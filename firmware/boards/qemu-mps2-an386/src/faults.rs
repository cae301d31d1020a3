//! Panics and hard faults: logged, then QEMU ends with an exit code, so that no test waits for ever.

use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, Ordering};

use cortex_m_rt::{ExceptionFrame, exception};

use crate::exit::Exit;

/// Whether a fault is being reported: a second one, from within the report, must not be reported.
static REPORTING: AtomicBool = AtomicBool::new(false);

/// Whether this is the first fault, which is reported.
fn first() -> bool {
    // Single core, and faults are not interrupted by tasks: load and store are not interleaved.
    let first = !REPORTING.load(Ordering::Relaxed);
    REPORTING.store(true, Ordering::Relaxed);
    first
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    cortex_m::interrupt::disable();
    if first() {
        // As plain text first: it needs no decoder, and survives a fault in the logger itself.
        semihosting::eprintln!("{info}");
        defmt::error!("{}", defmt::Display2Format(info));
    }
    Exit::Panic.now()
}

/// Address of the configurable fault status register.
const CFSR: usize = 0xE000_ED28;
/// Address of the bus fault address register.
const BFAR: usize = 0xE000_ED38;

#[allow(unsafe_code, reason = "an exception handler for hard faults must be declared unsafe")]
#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    if first() {
        let (pc, lr) = (frame.pc(), frame.lr());
        let (cfsr, bfar) = (crate::registers::read(CFSR), crate::registers::read(BFAR));
        semihosting::eprintln!(
            "hard fault at {pc:#010x}, called from {lr:#010x}; CFSR {cfsr:#010x}, BFAR {bfar:#010x}"
        );
        defmt::error!(
            "hard fault at {=u32:#010x}, called from {=u32:#010x}; CFSR {=u32:#010x}, BFAR {=u32:#010x}",
            pc,
            lr,
            cfsr,
            bfar
        );
    }
    Exit::HardFault.now()
}
