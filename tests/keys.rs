//! Keys of calibration updates.

use kou_app::update::{Key, KeySource};

use crate::samples::SplitMix64;

/// An update key made for the test that uses it.
#[derive(Debug, Clone)]
pub struct TestKey(Key);

impl TestKey {
    /// The key of a seed.
    #[must_use]
    pub fn from_seed(seed: u64) -> Self {
        let mut random = SplitMix64(seed);
        Self(Key::new(std::array::from_fn(|_| random.next_u64() as u8)))
    }

    /// The key itself.
    #[must_use]
    pub fn key(&self) -> &Key {
        &self.0
    }
}

impl KeySource for TestKey {
    fn update_key(&self) -> Option<Key> {
        Some(self.0.clone())
    }
}
