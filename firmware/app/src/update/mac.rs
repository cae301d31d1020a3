//! Authentication tag of an update: HMAC-SHA256 (RFC 2104, FIPS 180-4), compared in constant time.
//!
//! ```text
//! tag = HMAC-SHA256(key, "KOU-CAL-1" | counter u32 LE | length u16 LE | record)
//! ```
//!
//! The tag covers the counter, so an old update cannot be replayed under a new counter. The record names the machine.

use hmac::{Hmac, KeyInit, Mac};
use sha2::Sha256;

/// Length of a tag in bytes.
pub const TAG_LEN: usize = 32;
/// Domain separation: a tag made for another purpose or version with the same key differs.
const PURPOSE: &[u8] = b"KOU-CAL-1";

/// Shared key. Neither printed nor logged.
#[derive(Clone, PartialEq, Eq)]
pub struct Key([u8; 32]);

impl Key {
    /// Key of 32 bytes from a cryptographic random number generator.
    #[must_use]
    pub const fn new(bytes: [u8; 32]) -> Self {
        Self(bytes)
    }
}

impl core::fmt::Debug for Key {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("Key(..)")
    }
}

/// Source of the controller's key: a board reads it from a place that production wrote and nobody can read out, such
/// as one-time-programmable memory. Never part of the firmware's source.
pub trait KeySource {
    /// Key; `None` if none was written: then every update is rejected.
    fn update_key(&self) -> Option<Key>;
}

/// Board without a key: rejects every update.
#[derive(Debug, Clone, Copy, Default)]
pub struct NoKey;

impl KeySource for NoKey {
    fn update_key(&self) -> Option<Key> {
        None
    }
}

fn started(key: &Key, counter: u32, record: &[u8]) -> Option<Hmac<Sha256>> {
    let mut mac = Hmac::<Sha256>::new_from_slice(&key.0).ok()?;
    mac.update(PURPOSE);
    mac.update(&counter.to_le_bytes());
    mac.update(&u16::try_from(record.len()).ok()?.to_le_bytes());
    mac.update(record);
    Some(mac)
}

/// Tag of an update; `None` for a record longer than the format allows.
#[doc(alias = "HMAC")]
#[must_use]
pub fn tag(key: &Key, counter: u32, record: &[u8]) -> Option<[u8; TAG_LEN]> {
    let bytes = started(key, counter, record)?.finalize().into_bytes();
    <[u8; TAG_LEN]>::try_from(bytes.as_slice()).ok()
}

/// Whether a tag belongs to this update.
#[must_use]
pub fn is_authentic(key: &Key, counter: u32, record: &[u8], tag: &[u8]) -> bool {
    started(key, counter, record).is_some_and(|mac| mac.verify_slice(tag).is_ok())
}
