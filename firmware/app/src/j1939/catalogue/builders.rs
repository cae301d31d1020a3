//! Constructors of catalogue entries. On the target they drop the texts that only the DBC file needs.

use crate::j1939::signal::{Coding, Message, Signal};

pub(super) const fn plain(name: &'static str, start: u8, length: u8, comment: &'static str) -> Signal {
    Signal {
        name: text(name),
        spn: None,
        start,
        length,
        coding: Coding::Plain,
        scale: 1.0,
        offset: 0.0,
        unit: "",
        values: &[],
        comment: text(comment),
    }
}

/// Texts are for the DBC file, which only the host writes: without them the firmware is kilobytes smaller.
const fn text(text: &'static str) -> &'static str {
    if cfg!(target_os = "none") { "" } else { text }
}

impl Message {
    /// The message without the parts that only the DBC file needs; on the host, complete.
    pub(super) const fn carried(self) -> Self {
        if cfg!(target_os = "none") { Self { name: "", signals: &[], comment: "", ..self } } else { self }
    }
}

pub(super) const fn state(
    name: &'static str,
    start: u8,
    length: u8,
    values: &'static [(u32, &'static str)],
    comment: &'static str,
) -> Signal {
    let values = if cfg!(target_os = "none") { &[] } else { values };
    Signal { coding: Coding::State, values, ..plain(name, start, length, comment) }
}

/// Measured quantity of 16 bits at byte `byte`, counted from 0.
pub(super) const fn word(
    name: &'static str,
    byte: u8,
    scale: f32,
    offset: f32,
    unit: &'static str,
    comment: &'static str,
) -> Signal {
    Signal { coding: Coding::Measured, scale, offset, unit: text(unit), ..plain(name, 8 * byte, 16, comment) }
}

pub(super) const fn with_spn(signal: Signal, spn: u32) -> Signal {
    Signal { spn: Some(spn), ..signal }
}
