//! Facts that the server needs from the board it runs on.

/// What the tasks need to know from the board that they run on.
pub trait Board {
    /// Name of the board's crate.
    const NAME: &'static str;

    /// Deepest stack since start, in bytes.
    fn stack_high_water_bytes(&self) -> u32;

    /// Time since start in microseconds.
    fn uptime_us(&self) -> u64;
}
