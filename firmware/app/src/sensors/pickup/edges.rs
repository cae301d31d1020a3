//! Time stamps of a pickup's edges, as the board's timer delivers them each millisecond.

/// Edges per poll: three times those of 3000 r/min with 200 teeth in 1 ms.
pub const MAX_EDGES: usize = 32;

/// Edges since the last poll.
#[derive(Debug, Clone, Default)]
pub struct Edges {
    stamps: heapless::Vec<u32, MAX_EDGES>,
    pub(super) lost: bool,
}

impl Edges {
    /// No edges.
    #[must_use]
    pub const fn new() -> Self {
        Self { stamps: heapless::Vec::new(), lost: false }
    }

    /// Adds an edge, in order of time. Without room it is dropped, and the speed measurement restarts.
    pub fn push(&mut self, stamp: u32) {
        self.lost |= self.stamps.push(stamp).is_err();
    }

    /// Records that the hardware has lost edges.
    pub fn overrun(&mut self) {
        self.lost = true;
    }

    /// Removes every edge.
    pub fn clear(&mut self) {
        self.stamps.clear();
        self.lost = false;
    }

    /// Time stamps.
    #[must_use]
    pub fn stamps(&self) -> &[u32] {
        &self.stamps
    }
}
