//! The codes with which the firmware ends QEMU; `docs/firmware.md` lists them for users.

use semihosting::process;

/// Why the firmware ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, defmt::Format)]
pub enum Exit {
    /// The host asked for it.
    Shutdown = 0,
    /// The host closed the line without asking for the end.
    HostGone = 3,
    /// The line failed.
    LineFailed = 4,
    /// A task could not be started.
    Spawn = 5,
    /// A task was overdue, so the watchdog would reset the controller.
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
