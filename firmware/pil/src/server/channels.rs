//! Queues and counters between the tasks.

use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_sync::channel::Channel;
use kou_estimator::{Params, Sample};

use super::counters::Counters;
use super::in_flight::InFlight;
use crate::link::{CalibrationRejection, ErrorKind, Response};

/// Capacity of the queues of commands and of responses.
pub const QUEUE_LEN: usize = 16;

/// Response of the firmware, whose texts are literals.
pub type ServerResponse = Response<&'static str>;

/// Command to the estimate task, made by the task `link in` from a request or a rejected frame.
// A sample is most of a hundred bytes and almost every command is one: a box is neither possible nor useful.
#[allow(clippy::large_enum_variant, reason = "the large variant is the most frequent one")]
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ServerCommand {
    /// Identify.
    Hello,
    /// Activate the parameters in [`ServerChannels::candidate`].
    Adopt {
        /// CRC-32 of their record.
        crc: u32,
    },
    /// Report why a calibration was rejected.
    Reject(CalibrationRejection<&'static str>),
    /// Estimate.
    Sample(Sample),
    /// Report counters and state.
    Status,
    /// Report a rejected frame.
    ReportError(ErrorKind),
    /// Report the end of the firmware.
    Shutdown,
}

/// Channels and counters shared by the tasks.
pub struct ServerChannels<M: RawMutex> {
    /// From `link in` to `estimate`.
    pub commands: Channel<M, ServerCommand, QUEUE_LEN>,
    /// Checked parameters to be activated; separate from the commands because they are ten times as large.
    pub candidate: Channel<M, Params, 1>,
    /// From `estimate` to `link out`.
    pub responses: Channel<M, ServerResponse, QUEUE_LEN>,
    /// Requests received and not yet answered on the line.
    pub in_flight: InFlight<M>,
    /// Event counters.
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
