//! Reason for which a link task has ended.

/// Why a link task ended. A board decides what follows: the tasks themselves hold no opinion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum LinkEnd {
    /// The line was closed by the other side.
    Closed,
    /// The line failed.
    Failed,
    /// The host asked for the end, and has its answer.
    Shutdown,
}
