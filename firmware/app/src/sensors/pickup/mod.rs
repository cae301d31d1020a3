//! Shaft speed from a toothed wheel, by count and time stamp of its edges.
//!
//! The board's timer stamps every edge of one direction and hands them over each millisecond; [`PickupState::poll`] turns
//! them into counted tooth pitches and, from the first and the last of a window, into speed:
//!
//! ```text
//! n = 60 s/min * pitches / (teeth * (t_last - t_first))
//! ```
//!
//! Each edge is judged by the time since the last counted one, over the present pitch, the median of the last three:
//!
//! * below 0.6 of a pitch, or sooner than the fastest shaft could turn: a glitch, passed over;
//! * close to 2, 3, ... pitches: teeth missing, by a reference gap or by a lost edge, and counted as that many;
//! * longer, but at no whole number of pitches: a glitch inside a gap, passed over;
//! * otherwise one pitch.
//!
//! A shaft that changes its speed faster than these bounds allow looks like glitches or gaps: in a row, or, where half or
//! twice the pitch has been learned, every other edge. After [`RESYNC`] in a row, or when more than one edge in four is
//! odd, the pitch is learned anew, so no wrong guess lasts. More than one edge in five odd over some time is a fault.
//!
//! A speed is told once [`SETTLED`] pitches in a row have been alike and a window has begun; until then the reading keeps the
//! last one with its own, older time stamp. A glitch in the middle of a gap may cost one pitch of the window. Between edges
//! the speed is at most that of the longest gap, were it to end now, so it falls while none comes, and after `zero_ms` it
//! is zero: the slowest speed that is told from standstill is `60 000/(teeth*zero_ms)` r/min. A pickup that is
//! broken gives no edges either; only [`plausibility`](super::plausibility) can tell it from standstill.

mod config;
mod edges;
mod state;

pub use config::{PickupConfig, PickupParams};
pub use edges::{Edges, MAX_EDGES};
pub use state::{PickupCounts, PickupState, RESYNC, SETTLED};
