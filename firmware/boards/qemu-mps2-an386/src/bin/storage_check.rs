//! Self-test on the target: storage under power failures, frames and authentication tag, executed by the same code as
//! on a controller. The host's tests cover the same cases at length. Prints its results; a failure is a panic. Not
//! part of the product.
#![no_std]
#![no_main]

use cortex_m_rt::entry;
use embassy_futures::block_on;
use kou_app::diagnostics::ResetCause;
use kou_app::diagnostics::{FaultCode, FaultMemory, FreezeFrame};
use kou_app::storage::{BUFFER_LEN, MIN_BYTES, OperatingCounters, Store, StoreError};
use kou_emulation::RamFlash;
use kou_emulation::examples;
use kou_emulation::ram_flash::Torn;
use kou_estimator::record::crc32;
use kou_qemu_mps2_an386::QemuMps2An386;
use kou_qemu_mps2_an386::exit::Exit;
use semihosting::eprintln;

type SelfTestFlash = RamFlash<{ MIN_BYTES as usize }, 2048>;

fn store(flash: SelfTestFlash) -> Store<SelfTestFlash> {
    match Store::new(flash, 0..MIN_BYTES) {
        Ok(store) => store,
        Err(_) => panic!("the region cannot be used"),
    }
}

fn life(seconds: u32) -> OperatingCounters {
    let mut life = OperatingCounters::new();
    life.count_start(ResetCause::BrownOut);
    life.add_operating_time(seconds);
    life
}

fn faults(at: u32) -> FaultMemory {
    let mut memory = FaultMemory::new();
    for code in FaultCode::all().take(6) {
        memory.confirm(code, FreezeFrame::at(at));
    }
    memory
}

/// Interrupts the power at every byte of a write; returns the number of interruptions.
fn cut_everywhere(
    base: &SelfTestFlash,
    write: impl Fn(&mut Store<SelfTestFlash>) -> Result<(), StoreError>,
) -> usize {
    let mut whole = store(base.clone());
    let before = whole.flash().worked();
    assert!(write(&mut whole).is_ok());
    let places = whole.flash().worked() - before;
    for place in 0..places {
        let mut flash = base.clone();
        flash.cut_after(place, if place % 2 == 0 { Torn::Clean } else { Torn::Random(place as u32) });
        let mut cut_off = store(flash);
        assert!(write(&mut cut_off).is_err());
        let mut flash = cut_off.into_flash();
        flash.power_on();
        let mut after = store(flash);
        assert!(block_on(after.repair(&mut [0; BUFFER_LEN])).is_ok());
        let found = block_on(after.read::<OperatingCounters>());
        assert!(matches!(found, Ok(Some(found)) if found == life(1) || found == life(2)));
        let found = block_on(after.read::<FaultMemory>());
        assert!(matches!(&found, Ok(Some(found)) if found.entries() == faults(1).entries()
            || found.entries() == faults(2).entries()));
        assert!(write(&mut after).is_ok());
    }
    places
}

#[entry]
fn main() -> ! {
    QemuMps2An386::init();
    let mut base = store(SelfTestFlash::new());
    assert!(block_on(base.write(&life(1))).is_ok() && block_on(base.write(&faults(1))).is_ok());
    let base = base.into_flash();
    let lives = cut_everywhere(&base, |store| block_on(store.write(&life(2))));
    let memories = cut_everywhere(&base, |store| block_on(store.write(&faults(2))));
    let frames = crc32(examples::example_frames().as_flattened());
    let tag = examples::example_tag().map_or(0, |tag| crc32(&tag));
    eprintln!("cuts {} frames {:08x} tag {:08x}", lives + memories, frames, tag);
    Exit::Shutdown.now()
}
