//! Sizes of payloads and frames.

use kou_estimator::record;

use super::cobs;

/// Length of the CRC behind the payload.
pub const CRC_LEN: usize = 4;
/// Largest payload: a calibration record with tag and length.
pub const MAX_PAYLOAD: usize = record::calibration::MAX_LEN + 8;
/// Largest frame before encoding: payload and CRC.
pub const MAX_BODY: usize = MAX_PAYLOAD + CRC_LEN;
/// Largest encoded frame including its delimiter.
pub const MAX_FRAME: usize = cobs::max_encoded_len(MAX_BODY) + 1;
/// Largest payload of a response: a rejection that names a field and the reason.
pub const MAX_RESPONSE_PAYLOAD: usize = 192;
/// Largest encoded response including its delimiter.
pub const MAX_RESPONSE_FRAME: usize = cobs::max_encoded_len(MAX_RESPONSE_PAYLOAD + CRC_LEN) + 1;
