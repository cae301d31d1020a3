//! The firmware's tasks and what stands between them.
//!
//! ```text
//! line --> link in --commands--> estimate --responses--> link out --> line
//!             \----candidate----/              heartbeat (watches the counters)
//! ```
//!
//! Every task is a plain async function, generic over the line and the board; a board crate wraps each in an executor's
//! task. All of them share one [`ServerChannels`], which lives in a static. Commands and responses are queues, so answers leave in
//! the order of the requests; a full queue holds its sender back, which holds the line back: nothing is ever dropped.

mod board;
mod channels;
mod counters;
mod estimate;
mod heartbeat;
mod in_flight;
mod link_end;
mod link_in;
mod link_out;
#[cfg(test)]
mod tests;

pub use board::Board;
pub use channels::{QUEUE_LEN, ServerChannels, ServerCommand, ServerResponse};
pub use counters::Counters;
pub use estimate::run_estimate;
pub use heartbeat::run_heartbeat;
pub use in_flight::InFlight;
pub use link_end::LinkEnd;
pub use link_in::run_link_in;
pub use link_out::run_link_out;
