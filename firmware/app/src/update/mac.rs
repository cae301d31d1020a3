//! The authentication tag of an update: HMAC-SHA256 (RFC 2104, FIPS 180-4), compared in constant time.
//!
//! ```text
//! tag = HMAC-SHA256(key, "KOU-CAL-1" | counter u32 LE | length u16 LE | record)
//! ```
//!
//! The counter is in it, so that an old update with a new counter does not pass. The machine is in the record.

use hmac::{Hmac, KeyInit, Mac};
use sha2::Sha256;

/// Bytes of a tag.
pub const TAG_LEN: usize = 32;
/// What the tag is for: one of another purpose or version, by the same key, is another.
const PURPOSE: &[u8] = b"KOU-CAL-1";

/// A shared key. Neither printed nor logged.
#[derive(Clone, PartialEq, Eq)]
pub struct Key([u8; 32]);

impl Key {
    /// Takes 32 bytes of good random numbers.
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

/// Where the controller's key comes from: a board reads it from a place that production wrote and nobody reads out, such
/// as one-time-programmable memory. It never stands in the firmware's source.
pub trait KeySource {
    /// The key; nothing where none was written: then no update is taken.
    fn update_key(&self) -> Option<Key>;
}

/// A board without a key: it takes no update.
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

/// Tag of an update; nothing for a record that is longer than any may be.
#[must_use]
pub fn tag(key: &Key, counter: u32, record: &[u8]) -> Option<[u8; TAG_LEN]> {
    let bytes = started(key, counter, record)?.finalize().into_bytes();
    <[u8; TAG_LEN]>::try_from(bytes.as_slice()).ok()
}

/// Whether a tag is that of this update.
#[must_use]
pub fn is_authentic(key: &Key, counter: u32, record: &[u8], tag: &[u8]) -> bool {
    started(key, counter, record).is_some_and(|mac| mac.verify_slice(tag).is_ok())
}
