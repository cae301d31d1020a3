//! Writer of the controller's production page, which [`kou_app::update::provision`] reads.

use kou_app::update::provision::{KEY_LEN, LEN};

/// Builds a page; `None` when the calibration's record does not fit.
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
    use kou_app::update::Key;
    use kou_app::update::provision::{calibration, key};

    use super::*;

    #[test]
    fn written_page_is_read_and_an_erased_page_is_empty() {
        let blank = page(None, None).unwrap();
        assert!(key(&blank).is_none() && calibration(&blank).is_none());
        assert!(key(&[0; LEN]).is_none() && calibration(&[0; LEN]).is_none());
        let secret: [u8; KEY_LEN] = core::array::from_fn(|i| i as u8);
        let record = *b"KOUC\x03\x00\x05\x00abcdeCRCC";
        let both = page(Some(&secret), Some(&record)).unwrap();
        assert_eq!(key(&both), Some(Key::new(secret)));
        assert_eq!(calibration(&both), Some(&record[..]));
        // A length beyond the page is rejected.
        let mut wrong = both;
        wrong[KEY_LEN + 6..KEY_LEN + 8].fill(0xFF);
        assert_eq!(calibration(&wrong), None);
        assert!(page(None, Some(&[0; LEN])).is_none());
    }
}
