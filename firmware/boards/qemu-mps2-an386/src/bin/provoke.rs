//! Provokes a fault named on its command line, so that tests can check that it is logged and ends QEMU with its code:
//! `panic`, `hardfault`, anything else for a regular end. Not part of the product.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use kou_qemu_mps2_an386::QemuMps2An386;
use kou_qemu_mps2_an386::exit::Exit;
use semihosting::experimental::env;

#[entry]
fn main() -> ! {
    QemuMps2An386::init();
    let Ok(arguments) = env::args::<128>() else { Exit::LineFailed.now() };
    match (&arguments).into_iter().flatten().nth(1) {
        Some("panic") => panic!("provoked panic"),
        Some("hardfault") => cortex_m::asm::udf(),
        _ => Exit::Shutdown.now(),
    }
}
