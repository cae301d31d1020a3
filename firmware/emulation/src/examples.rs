//! Computed examples that tests compare between host and target: CAN frames and an authentication tag.

use kou_app::j1939::example::example_estimate;
use kou_app::j1939::publish;
use kou_app::update::{Key, TAG_LEN, mac};

/// Frames of an estimate with a valid and an invalid part, to be compared between target and host.
#[must_use]
pub fn example_frames() -> [[u8; 8]; 3] {
    let estimate = example_estimate();
    [publish::leakage(&estimate), publish::efficiency(&estimate), publish::validity(&estimate, 7)]
}

/// Authentication tag of a few bytes, to be compared likewise.
#[must_use]
pub fn example_tag() -> Option<[u8; TAG_LEN]> {
    mac::tag(&Key::new([7; 32]), 1, b"record")
}
