//! Helpers of the end-to-end tests: reference calibration, its record, samples, update keys and flash.
//!
//! A test that needs firmware or QEMU fails where they are missing; a skipped test would look like a passed one.

mod keys;
pub mod samples;

use host_sim::pil::{PilError, PilOptions};
pub use keys::TestKey;
use kou_app::storage::MIN_BYTES;
use kou_emulation::RamFlash;
use kou_estimator::{Calibration, Params, record};
pub use kou_fixture::reference as reference_calibration;

/// The binary record of a calibration.
#[must_use]
pub fn record_of(calibration: &Calibration) -> Vec<u8> {
    let mut bytes = vec![0; record::calibration::MAX_LEN];
    let len = record::calibration::encode(calibration, &mut bytes).expect("every calibration fits a record");
    bytes.truncate(len);
    bytes
}

/// Checked parameters of [`reference_calibration`].
#[must_use]
pub fn reference_params() -> Params {
    Params::new(&reference_calibration()).expect("the reference calibration passes every check")
}

/// Flash of the smallest region allowed, as on the STM32G474 in dual-bank mode: eight pages of 2 KiB, words of 8 bytes.
pub type TestFlash = RamFlash<{ MIN_BYTES as usize }, 2048>;

/// The value of a run through QEMU; a panic with the set-up command where QEMU or firmware is missing.
#[track_caller]
pub fn set_up<T>(result: Result<T, PilError>) -> T {
    match result {
        Ok(value) => value,
        Err(error @ (PilError::QemuMissing { .. } | PilError::FirmwareMissing { .. })) => {
            panic!("{error}\n`cargo xtask test` does this and then runs all tests")
        }
        Err(error) => panic!("{error}"),
    }
}

/// Options of the tests: the defaults of `host-sim`.
#[must_use]
pub fn pil_options() -> PilOptions {
    PilOptions::default()
}
