//! Sizes of an update transfer and of the buffer that receives it.

use kou_estimator::record;

use super::mac::TAG_LEN;
use super::wire::SEGMENT;
use crate::storage;

/// Longest transfer: a calibration record and its tag.
pub const MAX_TRANSFER: usize = record::calibration::MAX_LEN + TAG_LEN;

/// Length of the session's buffer, which also serves as scratch memory of [`crate::storage::Store::repair`].
pub const BUFFER_LEN: usize =
    if MAX_TRANSFER > storage::BUFFER_LEN { MAX_TRANSFER } else { storage::BUFFER_LEN };

// A segment number is one byte.
const _: () = assert!(MAX_TRANSFER <= 256 * SEGMENT);
