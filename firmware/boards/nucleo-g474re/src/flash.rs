//! Flash: region of the records, production page, and handling of words damaged by a power failure.
//!
//! | from | bytes | what |
//! |---|---|---|
//! | 0x0800_0000 | 256 KiB, bank 1 | the firmware |
//! | 0x0807_0000 | 32 KiB, bank 2 | records: 16 pages, written by the firmware |
//! | 0x0807_F800 | 2 KiB, bank 2 | production page: written once, by the probe |
//!
//! While bank 2 is erased (22 ms a page) or programmed (about 85 us for 8 bytes), the processor continues in bank 1;
//! the writing task waits for an interrupt. Flashing new firmware does not change bank 2. The driver's interrupt
//! clears the flash's error flags before they can be read, so a failed write is not detected here: the store reads
//! every record back.
//!
//! A power failure during programming can leave a word whose two-bit ECC error raises the non-maskable interrupt when
//! it is read. In bank 2 that is expected: the flag is cleared, the CRC of the data does not match, and the record's
//! other copy is used. In bank 1 the firmware itself is damaged: it stops with a crash record.

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

/// Range of the records, as offsets in flash.
const RECORDS: core::ops::Range<u32> = 0x7_0000..0x7_8000;
/// Address of the production page.
const PROVISION: usize = 0x0807_F800;

/// Content of the production page; all ones when not written.
fn provisioned() -> &'static [u8; provision::LEN] {
    #[allow(unsafe_code, reason = "flash outside the program, by its address")]
    // SAFETY: the page is flash of this chip beyond the program and the records, so nothing writes it while the firmware
    // runs; it is aligned to its size, and any bytes are valid.
    unsafe {
        &*(PROVISION as *const [u8; provision::LEN])
    }
}

/// Default calibration from the production page, if written.
pub(crate) fn default_calibration() -> Option<&'static [u8]> {
    provision::calibration(provisioned())
}

/// Key from the production page.
pub(crate) struct Provisioned;

impl KeySource for Provisioned {
    fn update_key(&self) -> Option<Key> {
        provision::key(provisioned())
    }
}

/// Record store in its region. Rejected when the region is unusable, or the chip's flash is configured as one bank
/// (option bit DBANK): pages then have another size, and an erasure would stall the processor.
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
        // Cleared by writing one.
        pac::FLASH.eccr().modify(|eccr| eccr.set_eccd(true));
    } else {
        watchdog::stop(if ecc.eccd() {
            "flash is damaged: ECC"
        } else {
            "non-maskable interrupt: clock or RAM"
        });
    }
}
