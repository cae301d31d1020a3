//! Board-specific functions that the server needs.

/// Board on which the tasks run.
pub trait Board {
    /// Name of the board's crate.
    const NAME: &'static str;

    /// Deepest stack since start, in bytes.
    fn stack_high_water_bytes(&self) -> u32;

    /// Time since start in microseconds.
    fn uptime_us(&self) -> u64;
}
