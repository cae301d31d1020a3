//! QEMU's mps2-an386 (Cortex-M4F at 25 MHz) as a board of the leakage estimator.
//!
//! | module | duty |
//! |---|---|
//! | [`time`] | time driver on the two CMSDK timers, in microseconds |
//! | [`mod@line`] | the link's line: a pair of files or FIFOs reached by semihosting |
//! | [`uart`] | the same over UART 0 |
//! | [`priority`] | the controller's executors, of three priorities |
//! | [`emulated`] | the controller's hardware, whose other end is the host |
//! | [`stack`] | how deep the stack has been |
//! | [`exit`] | the codes with which the firmware ends QEMU |
//! | `faults` | panics and hard faults: logged, then the end of QEMU with a code |
//! | `interrupts` | numbers of the interrupts in use |
//! | `vectors` | interrupt vector table |
//!
//! `unsafe` stands in the modules that touch hardware, each use with its reason, and nowhere else.
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

/// The board as the tasks see it.
#[derive(Debug, Clone, Copy)]
pub struct QemuMps2An386;

impl QemuMps2An386 {
    /// Starts the clock. Call it first.
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
