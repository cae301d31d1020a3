//! Queues and counters between the tasks.

use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_sync::channel::Channel;
use kou_estimator::{Params, Sample};

use super::counters::Counters;
use super::in_flight::InFlight;
use crate::link::{CalibrationRejection, ErrorKind, Response};

/// Number of commands, and of responses, that may wait.
pub const QUEUE_LEN: usize = 16;

/// A response as the firmware makes it: its texts are literals.
pub type ServerResponse = Response<&'static str>;

/// What the link asks of the estimate task; made by `link in` from a request or from what was no request.
// A sample is most of a hundred bytes and nearly every command is one: a box is neither possible nor useful.
#[allow(clippy::large_enum_variant, reason = "the large variant is the usual one")]
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ServerCommand {
    /// Tell who is there.
    Hello,
    /// Take the parameters that wait in [`ServerChannels::candidate`] into use.
    Adopt {
        /// CRC-32 of the record that they come from.
        crc: u32,
    },
    /// Tell why a calibration was refused.
    Reject(CalibrationRejection<&'static str>),
    /// Estimate.
    Sample(Sample),
    /// Tell the counters.
    Status,
    /// Tell that something was no request.
    ReportError(ErrorKind),
    /// Tell that the firmware ends.
    Shutdown,
}

/// Channels and counters that the tasks share.
pub struct ServerChannels<M: RawMutex> {
    /// From `link in` to `estimate`.
    pub commands: Channel<M, ServerCommand, QUEUE_LEN>,
    /// Checked parameters on their way into use; apart from the commands because they are ten times as large.
    pub candidate: Channel<M, Params, 1>,
    /// From `estimate` to `link out`.
    pub responses: Channel<M, ServerResponse, QUEUE_LEN>,
    /// Requests taken from the line and not yet answered on it.
    pub in_flight: InFlight<M>,
    /// What has happened so far.
    pub counters: Counters,
}

impl<M: RawMutex> ServerChannels<M> {
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

impl<M: RawMutex> Default for ServerChannels<M> {
    fn default() -> Self {
        Self::new()
    }
}
