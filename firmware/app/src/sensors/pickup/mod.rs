//! Shaft speed from a toothed wheel, by count and time stamp of its edges (period measurement).
//!
//! The board's timer stamps every rising edge and delivers them each millisecond; [`PickupState::poll`] converts them
//! into counted tooth pitches and, from the first and the last of a window, into speed:
//!
//! ```text
//! n = 60 s/min * pitches / (teeth * (t_last - t_first))
//! ```
//!
//! Each edge is classified by the time since the last counted one relative to the present pitch, the median of the
//! last three:
//!
//! * below 0.6 of a pitch, or sooner than possible at maximum speed: a glitch, ignored;
//! * close to 2, 3, ... pitches: missing teeth of a reference gap, or a lost edge, counted as that many;
//! * longer, but not a whole number of pitches: a glitch inside a gap, ignored;
//! * otherwise one pitch.
//!
//! A speed that changes faster than these bounds allow appears as glitches or gaps: consecutive ones, or, when half
//! or twice the pitch has been learned, at every other edge. After [`RESYNC`] consecutive irregular edges, or when
//! more than one edge in four is irregular, the pitch is learned anew, so no wrong pitch persists. More than one
//! irregular edge in five over some time is a fault.
//!
//! A speed is valid once [`SETTLED`] consecutive pitches have been similar and a window has begun; until then the
//! reading repeats the last one with its own, older time stamp. A glitch in the middle of a gap may cost one pitch of
//! the window. Between edges the speed is bounded by that of the longest gap ending now, so it falls while no edge
//! arrives, and after `zero_ms` it is zero: the slowest speed distinguished from standstill is `60
//! 000/(teeth*zero_ms)` r/min. A broken pickup gives no edges either; only [`plausibility`](super::plausibility)
//! distinguishes it from standstill.

mod config;
mod edges;
mod state;

pub use config::{PickupConfig, PickupParams};
pub use edges::{Edges, MAX_EDGES};
pub use state::{PickupCounts, PickupState, RESYNC, SETTLED};
