//! The page that production writes with the probe: the controller's key, and a calibration to begin with.
//!
//! ```text
//! offset 0    key          32 bytes; all ones (erased flash) or all zeros: none
//!        32   calibration  binary record of a calibration; anything else: none
//!        ...  unused       ones
//! ```
//!
//! The firmware never writes it. A key in plain flash is as safe as the chip's read-out protection; a board that has
//! one-time-programmable memory to spare can keep it there instead.

use kou_estimator::record;

use super::mac::Key;

/// Bytes of the page.
pub const LEN: usize = 2048;
/// Bytes of the key.
pub const KEY_LEN: usize = 32;
/// Head of a record: magic, schema, length of the payload; and its CRC.
const HEAD: usize = 8;
const TAIL: usize = 4;

/// The key in the page.
#[must_use]
pub fn key(page: &[u8; LEN]) -> Option<Key> {
    let (bytes, _) = page.split_first_chunk::<KEY_LEN>()?;
    let is_written = |blank: u8| bytes.iter().any(|byte| *byte != blank);
    (is_written(0xFF) && is_written(0)).then(|| Key::new(*bytes))
}

/// The record of the calibration in the page, by its head; whether it is good is for its reader to say.
#[must_use]
pub fn calibration(page: &[u8; LEN]) -> Option<&[u8]> {
    let record = page.get(KEY_LEN..)?;
    let (&[m0, m1, m2, m3, _, _, l0, l1], _) = record.split_first_chunk::<HEAD>()?;
    let length = usize::from(u16::from_le_bytes([l0, l1])).checked_add(HEAD.saturating_add(TAIL))?;
    ([m0, m1, m2, m3] == record::calibration::MAGIC).then(|| record.get(..length)).flatten()
}
