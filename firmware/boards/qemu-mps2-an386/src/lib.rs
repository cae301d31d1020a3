//! Board support for QEMU's mps2-an386 (Cortex-M4F at 25 MHz).
//!
//! | module | duty |
//! |---|---|
//! | [`time`] | time driver on the two CMSDK timers, in microseconds |
//! | [`mod@line`] | line of the PIL link: a pair of files or FIFOs, accessed by semihosting |
//! | [`uart`] | the same line over UART 0 |
//! | [`priority`] | executors of the controller, of four priorities |
//! | [`emulated`] | emulated hardware of the controller, simulated by the host |
//! | [`stack`] | high-water mark of the stack |
//! | [`exit`] | exit codes of QEMU |
//! | `faults` | panics and hard faults: logged, then the end of QEMU with an exit code |
//! | `interrupts` | numbers of the interrupts in use |
//! | `vectors` | interrupt vector table |
//!
//! Only modules that access hardware contain `unsafe`, each use with its reason.
#![no_std]
#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

pub mod emulated;
pub mod exit;
mod faults;
mod interrupts;
pub mod line;
pub mod priority;
mod registers;
pub mod stack;
pub mod time;
pub mod uart;
mod vectors;

use defmt_semihosting as _;
use kou_pil::server::Board;

defmt::timestamp!("{=u64:us}", embassy_time::Instant::now().as_micros());

/// The board, for the PIL server.
#[derive(Debug, Clone, Copy)]
pub struct QemuMps2An386;

impl QemuMps2An386 {
    /// Starts the clock. To be called first.
    pub fn init() -> Self {
        time::init();
        Self
    }
}

impl Board for QemuMps2An386 {
    const NAME: &'static str = env!("CARGO_PKG_NAME");

    fn stack_high_water_bytes(&self) -> u32 {
        stack::high_water_bytes()
    }

    fn uptime_us(&self) -> u64 {
        embassy_time::Instant::now().as_micros()
    }
}
