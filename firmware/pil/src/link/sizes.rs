//! Sizes of payloads and frames.

use kou_estimator::record;

use super::cobs;

/// Bytes of CRC behind the payload.
pub const CRC_LEN: usize = 4;
/// Largest payload: a calibration record with its tag and its length.
pub const MAX_PAYLOAD: usize = record::calibration::MAX_LEN + 8;
/// Largest frame before stuffing: payload and CRC.
pub const MAX_BODY: usize = MAX_PAYLOAD + CRC_LEN;
/// Largest frame on the line, its closing zero included.
pub const MAX_FRAME: usize = cobs::max_encoded_len(MAX_BODY) + 1;
/// Largest payload of a response: a refusal that names a field and says why.
pub const MAX_RESPONSE_PAYLOAD: usize = 192;
/// Largest response on the line, its closing zero included.
pub const MAX_RESPONSE_FRAME: usize = cobs::max_encoded_len(MAX_RESPONSE_PAYLOAD + CRC_LEN) + 1;
