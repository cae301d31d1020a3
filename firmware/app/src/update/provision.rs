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

use super::Key;

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

/// Makes a page; nothing where the calibration's record does not fit.
#[must_use]
pub fn page(key: Option<&[u8; KEY_LEN]>, calibration: Option<&[u8]>) -> Option<[u8; LEN]> {
    let mut page = [0xFF; LEN];
    let (key_place, rest) = page.split_first_chunk_mut::<KEY_LEN>()?;
    if let Some(key) = key {
        *key_place = *key;
    }
    if let Some(record) = calibration {
        rest.get_mut(..record.len())?.copy_from_slice(record);
    }
    Some(page)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_production_wrote_is_read_and_an_erased_page_holds_nothing() {
        let blank = page(None, None).unwrap();
        assert!(key(&blank).is_none() && calibration(&blank).is_none());
        assert!(key(&[0; LEN]).is_none() && calibration(&[0; LEN]).is_none());
        let secret: [u8; KEY_LEN] = core::array::from_fn(|i| i as u8);
        let record = *b"KOUC\x03\x00\x05\x00abcdeCRCC";
        let both = page(Some(&secret), Some(&record)).unwrap();
        assert_eq!(key(&both), Some(Key::new(secret)));
        assert_eq!(calibration(&both), Some(&record[..]));
        // A length beyond the page is not followed.
        let mut wrong = both;
        wrong[KEY_LEN + 6..KEY_LEN + 8].fill(0xFF);
        assert_eq!(calibration(&wrong), None);
        assert!(page(None, Some(&[0; LEN])).is_none());
    }
}
