//! Flash: where records are init_static, the page that production writes, and words that a power cut has spoilt.
//!
//! | from | bytes | what |
//! |---|---|---|
//! | 0x0800_0000 | 256 KiB, bank 1 | the firmware |
//! | 0x0807_0000 | 32 KiB, bank 2 | records: 16 pages, written by the firmware |
//! | 0x0807_F800 | 2 KiB, bank 2 | provisioning: written once, by the probe |
//!
//! While bank 2 is erased (22 ms a page) or programmed (some 85 us for 8 bytes), the processor goes on in bank 1; the task that
//! writes waits for an interrupt. Flashing new firmware leaves bank 2 alone. The driver's interrupt clears the flash's error
//! flags before anybody has read them, so a write that failed is not seen here: the store reads every record back.
//!
//! A power cut in the middle of programming can leave a word whose two-bit ECC error raises the non-maskable interrupt
//! when it is read. In bank 2 that is expected: the flag is cleared, what is read has no CRC that matches, and the
//! record's other copy is used. In bank 1 it is the firmware itself that is damaged: a stop, with a note.

use cortex_m_rt::exception;
use embassy_stm32::Peri;
pub(crate) use embassy_stm32::flash::Async as Mode;
use embassy_stm32::flash::{Flash, InterruptHandler};
use embassy_stm32::interrupt::typelevel::{self, Binding};
use embassy_stm32::pac;
use embassy_stm32::peripherals::FLASH;
use kou_app::storage::{RegionError, Store};
use kou_app::update::{Key, KeySource, provision};

use crate::watchdog;

/// First byte of the records, from the flash's beginning, and the one behind the last.
const RECORDS: core::ops::Range<u32> = 0x7_0000..0x7_8000;
/// Address of the page that production writes.
const PROVISION: usize = 0x0807_F800;

/// What production wrote; all ones where it has not.
fn provisioned() -> &'static [u8; provision::LEN] {
    #[allow(unsafe_code, reason = "flash outside the program, by its address")]
    // SAFETY: the page is flash of this chip beyond the program and the records, so nothing writes it while the firmware
    // runs; it is aligned to its size, and any bytes are valid.
    unsafe {
        &*(PROVISION as *const [u8; provision::LEN])
    }
}

/// The type's calibration that production wrote, if it did.
pub(crate) fn default_calibration() -> Option<&'static [u8]> {
    provision::calibration(provisioned())
}

/// The key that production wrote.
pub(crate) struct Provisioned;

impl KeySource for Provisioned {
    fn update_key(&self) -> Option<Key> {
        provision::key(provisioned())
    }
}

/// The records' region; refused when it cannot be used, or the chip's flash is set up as one bank (option bit DBANK): the pages are then of
/// another size, and an erasure would stop the processor.
pub(crate) fn store(
    flash: Peri<'static, FLASH>,
    irqs: impl Binding<typelevel::FLASH, InterruptHandler> + 'static,
) -> Result<Store<Flash<'static, Mode>>, RegionError> {
    if !pac::FLASH.optr().read().dbank() {
        return Err(RegionError::Pages);
    }
    Store::new(Flash::new(flash, irqs), RECORDS)
}

#[allow(unsafe_code, reason = "an exception handler must be declared unsafe")]
#[exception]
unsafe fn NonMaskableInt() {
    let ecc = pac::FLASH.eccr().read();
    if ecc.eccd() && ecc.bk_ecc() {
        // Written as one, it clears.
        pac::FLASH.eccr().modify(|eccr| eccr.set_eccd(true));
    } else {
        watchdog::stop(if ecc.eccd() {
            "flash is damaged: ECC"
        } else {
            "non-maskable interrupt: clock or RAM"
        });
    }
}
