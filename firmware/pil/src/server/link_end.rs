//! Reason for which a link task has ended.

/// Reason for which a link task has ended. The board decides what follows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum LinkEnd {
    /// The other side closed the line.
    Closed,
    /// The line failed.
    Failed,
    /// The host requested a shutdown, and has been answered.
    Shutdown,
}
