//! The firmware's tasks and what stands between them.
//!
//! ```text
//! line --> link in --commands--> estimate --responses--> link out --> line
//!             \----candidate----/              heartbeat (watches the counters)
//! ```
//!
//! Every task is a plain async function, generic over the line and the board; a board crate wraps each in an executor's
//! task. All of them share one [`Bus`], which lives in a static. Commands and responses are queues, so answers leave in
//! the order of the requests; a full queue holds its sender back, which holds the line back: nothing is ever dropped.

mod counters;
mod estimate;
mod heartbeat;
mod in_flight;
mod link_in;
mod link_out;
#[cfg(test)]
mod tests;

pub use counters::Counters;
pub use estimate::run_estimate;
pub use heartbeat::run_heartbeat;
pub use in_flight::InFlight;
pub use link_in::run_link_in;
pub use link_out::run_link_out;

use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_sync::channel::Channel;
use kou_estimator::{Params, Sample};

use crate::link::{ErrorKind, Refusal, Response};

/// Number of commands, and of responses, that may wait.
pub const QUEUE_LEN: usize = 16;

/// What the tasks need to know from the board that they run on.
pub trait Board {
    /// Name of the board's crate.
    const NAME: &'static str;

    /// Deepest stack since start, in bytes.
    fn stack_high_water_bytes(&self) -> u32;

    /// Time since start in microseconds.
    fn uptime_us(&self) -> u64;
}

/// A response as the firmware makes it: its texts are literals.
pub type Answer = Response<&'static str>;

/// What the link asks of the estimate task; made by `link in` from a request or from what was no request.
// A sample is most of a hundred bytes and nearly every command is one: a box is neither possible nor useful.
#[allow(clippy::large_enum_variant, reason = "the large variant is the usual one")]
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Command {
    /// Tell who is there.
    Hello,
    /// Take the parameters that wait in [`Bus::candidate`] into use.
    Adopt {
        /// CRC-32 of the record that they come from.
        crc: u32,
    },
    /// Tell why a calibration was refused.
    Refuse(Refusal<&'static str>),
    /// Estimate.
    Sample(Sample),
    /// Tell the counters.
    Status,
    /// Tell that something was no request.
    Complain(ErrorKind),
    /// Tell that the firmware ends.
    Shutdown,
}

/// Channels and counters that the tasks share.
pub struct Bus<M: RawMutex> {
    /// From `link in` to `estimate`.
    pub commands: Channel<M, Command, QUEUE_LEN>,
    /// Checked parameters on their way into use; apart from the commands because they are ten times as large.
    pub candidate: Channel<M, Params, 1>,
    /// From `estimate` to `link out`.
    pub responses: Channel<M, Answer, QUEUE_LEN>,
    /// Requests taken from the line and not yet answered on it.
    pub in_flight: InFlight<M>,
    /// What has happened so far.
    pub counters: Counters,
}

impl<M: RawMutex> Bus<M> {
    /// Empty channels.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            commands: Channel::new(),
            candidate: Channel::new(),
            responses: Channel::new(),
            in_flight: InFlight::new(),
            counters: Counters::new(),
        }
    }
}

impl<M: RawMutex> Default for Bus<M> {
    fn default() -> Self {
        Self::new()
    }
}

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
