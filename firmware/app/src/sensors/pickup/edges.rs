//! What a board's timer hands over in each millisecond: stamps of one direction's edges. Their meaning is the pickup's.

/// Edges that one poll may bring: 3000 r/min with 200 teeth for 1 ms, three times over.
pub const MAX_EDGES: usize = 32;

/// Edges since the last poll, as the board's timer stamped them.
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

    /// Adds an edge, in the order of time. Without room it is dropped, and the speed takes a new start.
    pub fn push(&mut self, stamp: u32) {
        self.lost |= self.stamps.push(stamp).is_err();
    }

    /// Says that the hardware has dropped edges.
    pub fn overrun(&mut self) {
        self.lost = true;
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        self.stamps.clear();
        self.lost = false;
    }

    /// The stamps.
    #[must_use]
    pub fn stamps(&self) -> &[u32] {
        &self.stamps
    }
}
