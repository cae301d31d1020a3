//! A measured figure of the firmware.

/// One figure, without its limit.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Figure {
    /// Name in `limits.toml` and in the JSON.
    pub key: &'static str,
    /// Meaning, for people.
    pub what: &'static str,
    /// Unit, for people.
    pub unit: &'static str,
    /// Value.
    pub value: u64,
}

/// A figure.
pub const fn figure(key: &'static str, what: &'static str, unit: &'static str, value: u64) -> Figure {
    Figure { key, what, unit, value }
}

/// A figure in bytes.
pub const fn bytes(key: &'static str, what: &'static str, value: u64) -> Figure {
    figure(key, what, "bytes", value)
}
