//! Sizes of an update transfer and of the buffer that receives it.

use kou_estimator::calibration::record;

use super::mac::TAG_LEN;
use super::wire::SEGMENT;
use crate::storage;

/// Longest transfer: a calibration record and its tag.
pub const MAX_TRANSFER: usize = record::MAX_LEN + TAG_LEN;

/// Bytes of the session's buffer, which also serves as [`crate::storage::Store::repair`]'s scratch memory.
pub const BUFFER_LEN: usize =
    if MAX_TRANSFER > storage::BUFFER_LEN { MAX_TRANSFER } else { storage::BUFFER_LEN };

// A segment's number is one byte.
const _: () = assert!(MAX_TRANSFER <= 256 * SEGMENT);
