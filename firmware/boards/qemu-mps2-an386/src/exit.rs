//! Exit codes with which the firmware ends QEMU; `docs/firmware.md` lists them for users.

use semihosting::process;

/// Reason for the end of the firmware.
#[derive(Debug, Clone, Copy, PartialEq, Eq, defmt::Format)]
pub enum Exit {
    /// Requested by the host.
    Shutdown = 0,
    /// Line closed by the host without a shutdown.
    HostGone = 3,
    /// The line failed.
    LineFailed = 4,
    /// Task not started.
    Spawn = 5,
    /// Task overdue: the watchdog would reset the controller.
    Watchdog = 6,
    /// A panic.
    Panic = 101,
    /// A hard fault.
    HardFault = 102,
}

impl Exit {
    /// Ends QEMU with this code.
    pub fn now(self) -> ! {
        process::exit(self as i32)
    }
}
