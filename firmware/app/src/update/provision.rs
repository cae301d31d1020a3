//! Production page: the controller's key and first calibration, written with a debug probe.
//!
//! ```text
//! offset 0    key          32 bytes; all ones (erased flash) or all zeros: none
//!        32   calibration  binary record of a calibration; anything else: none
//!        ...  unused       ones
//! ```
//!
//! The firmware never writes it. A key in plain flash is as secure as the chip's read-out protection; a board with
//! one-time-programmable memory can store it there instead.

use kou_estimator::record;

use super::mac::Key;

/// Length of the page in bytes.
pub const LEN: usize = 2048;
/// Length of the key in bytes.
pub const KEY_LEN: usize = 32;
/// Record header (magic number, schema, payload length), and the CRC behind the payload.
const HEAD: usize = 8;
const TAIL: usize = 4;

/// Key in the page.
#[must_use]
pub fn key(page: &[u8; LEN]) -> Option<Key> {
    let (bytes, _) = page.split_first_chunk::<KEY_LEN>()?;
    let is_written = |blank: u8| bytes.iter().any(|byte| *byte != blank);
    (is_written(0xFF) && is_written(0)).then(|| Key::new(*bytes))
}

/// Calibration record in the page, located by its header; its content is not checked here.
#[must_use]
pub fn calibration(page: &[u8; LEN]) -> Option<&[u8]> {
    let record = page.get(KEY_LEN..)?;
    let (&[m0, m1, m2, m3, _, _, l0, l1], _) = record.split_first_chunk::<HEAD>()?;
    let length = usize::from(u16::from_le_bytes([l0, l1])).checked_add(HEAD.saturating_add(TAIL))?;
    ([m0, m1, m2, m3] == record::calibration::MAGIC).then(|| record.get(..length)).flatten()
}
