//! Server on the target: tasks that answer the messages of the link.
//!
//! ```text
//! line --> link in --commands--> estimate --responses--> link out --> line
//!             \----candidate----/              heartbeat (watches the counters)
//! ```
//!
//! Every task is a plain async function, generic over line and board; a board crate wraps each in an executor's task.
//! All tasks share one [`ServerChannels`], which is a static. Commands and responses are queued, so answers are in
//! the order of the requests; a full queue blocks its sender and thereby the line: nothing is ever dropped.

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
