//! Messages between host and firmware.
//!
//! Messages are in postcard's wire format, which identifies variants and fields by position: extend an enum by
//! appending, never reorder, and increment [`PROTOCOL`] when the meaning of an existing message changes. Texts have
//! the type `S`: string literals in the firmware, which does not allocate, and owned strings on the host.

use core::fmt;

use kou_estimator::record::RecordError;
use kou_estimator::{CalibrationError, Estimate, Problem, Sample};
use serde::{Deserialize, Serialize};

use super::frame::FrameError;

/// Version of the link's protocol, part of [`Response::Hello`]. 2: estimates include health.
pub const PROTOCOL: u16 = 2;

/// Request of the host. Every request is answered by exactly one [`Response`], in order.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Request<'a> {
    /// Identification; answered by [`Response::Hello`].
    Hello,
    /// Calibration as a binary record; takes effect with its answer, [`Response::CalibrationAccepted`], and resets
    /// the estimator's state. A rejected calibration changes nothing.
    LoadCalibration(&'a [u8]),
    /// Sample to estimate from; answered by [`Response::Estimate`], or [`ErrorKind::NoCalibration`].
    Sample(Sample),
    /// Counters and state; answered by [`Response::Status`].
    Status,
    /// Shutdown of the firmware in an emulator; a board restarts. Answered by [`Response::ShuttingDown`], the last
    /// response.
    Shutdown,
}

impl Request<'_> {
    /// Number of requests known to this version.
    pub const COUNT: u32 = 5;
}

/// Response of the firmware.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Response<S> {
    /// Identification.
    Hello(Hello<S>),
    /// The calibration is in use.
    CalibrationAccepted {
        /// CRC-32 of the record, for comparison by the host.
        crc: u32,
    },
    /// The calibration was rejected; a previous one remains in use.
    CalibrationRejected(CalibrationRejection<S>),
    /// Estimate for one sample.
    Estimate(Estimate),
    /// Counters and state.
    Status(Status),
    /// The request was not executed.
    Error(ErrorKind),
    /// The firmware ends after this response.
    ShuttingDown,
}

impl<S> Response<S> {
    /// Number of responses known to this version.
    pub const COUNT: u32 = 7;
}

/// Identification of the firmware.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Hello<S> {
    /// [`PROTOCOL`] of the firmware.
    pub protocol: u16,
    /// Schema of the calibration records that it reads.
    pub record_schema: u16,
    /// Version of the firmware.
    pub version: S,
    /// Name of the board's crate.
    pub board: S,
}

/// Reason why a request was not executed. On the wire by position: append only.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ErrorKind {
    /// The received frame was no request.
    Frame(FrameError),
    /// Sample before any calibration.
    NoCalibration,
}

impl fmt::Display for ErrorKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Frame(error) => error.fmt(f),
            Self::NoCalibration => f.write_str("a sample came before any calibration"),
        }
    }
}

/// Reason for rejecting a calibration.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum CalibrationRejection<S> {
    /// Unreadable record.
    Record(RecordError),
    /// Invalid field.
    Field {
        /// Dotted name of the field as in the TOML form, for instance `oil.bulk_modulus_mpa`.
        field: S,
        /// Problem with its value.
        problem: FieldProblem<S>,
    },
}

/// Problem with a field of a calibration: the estimator's [`Problem`] in serialisable form.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum FieldProblem<S> {
    /// NaN or infinite.
    NotFinite,
    /// Outside the allowed range.
    OutOfRange {
        /// The value.
        value: f32,
        /// Smallest allowed value.
        min: f32,
        /// Largest allowed value.
        max: f32,
    },
    /// In range by itself, but inconsistent with another field.
    Inconsistent(S),
}

impl From<CalibrationError> for CalibrationRejection<&'static str> {
    fn from(error: CalibrationError) -> Self {
        let problem = match error.problem {
            Problem::NotFinite => FieldProblem::NotFinite,
            Problem::OutOfRange { value, min, max } => FieldProblem::OutOfRange { value, min, max },
            Problem::Inconsistent(why) => FieldProblem::Inconsistent(why),
        };
        Self::Field { field: error.field, problem }
    }
}

impl<S> From<RecordError> for CalibrationRejection<S> {
    fn from(error: RecordError) -> Self {
        Self::Record(error)
    }
}

impl<S: fmt::Display> fmt::Display for CalibrationRejection<S> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Record(error) => error.fmt(f),
            Self::Field { field, problem } => match problem {
                FieldProblem::NotFinite => write!(f, "`{field}` is not a finite number"),
                FieldProblem::OutOfRange { value, min, max } => {
                    write!(f, "`{field}` is {value}; allowed: {min} to {max}")
                }
                FieldProblem::Inconsistent(why) => write!(f, "`{field}` is inconsistent: {why}"),
            },
        }
    }
}

/// State of the firmware.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Status {
    /// Time since start by the firmware's own clock, in microseconds.
    pub uptime_us: u64,
    /// Deepest stack since start, in bytes.
    pub stack_high_water_bytes: u32,
    /// CRC-32 of the calibration record in use, if any.
    pub calibration: Option<u32>,
    /// Event counters.
    pub counts: LinkCounts,
}

/// Event counters since start. Each count saturates.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct LinkCounts {
    /// Valid requests, including this one.
    pub frames_ok: u32,
    /// Frames rejected as [`FrameError::TooLong`].
    pub frames_too_long: u32,
    /// Frames rejected as [`FrameError::TooShort`].
    pub frames_too_short: u32,
    /// Frames rejected as [`FrameError::Cobs`].
    pub frames_cobs: u32,
    /// Frames rejected as [`FrameError::Crc`].
    pub frames_crc: u32,
    /// Frames rejected as [`FrameError::Unknown`].
    pub frames_unknown: u32,
    /// Frames rejected as [`FrameError::Payload`].
    pub frames_payload: u32,
    /// Samples received.
    pub samples: u32,
    /// Samples before any calibration.
    pub samples_without_calibration: u32,
    /// Estimates with both parts valid.
    pub estimates_valid: u32,
    /// Estimates with an invalid part.
    pub estimates_rejected: u32,
    /// Accepted calibrations.
    pub calibrations_accepted: u32,
    /// Rejected calibrations.
    pub calibrations_rejected: u32,
    /// Periods of the heartbeat task.
    pub heartbeats: u32,
}

impl LinkCounts {
    /// Rejected frames of every kind.
    #[must_use]
    pub fn frames_rejected(&self) -> u32 {
        [
            self.frames_too_long,
            self.frames_too_short,
            self.frames_cobs,
            self.frames_crc,
            self.frames_unknown,
            self.frames_payload,
        ]
        .into_iter()
        .fold(0, u32::saturating_add)
    }
}

/// Decodes a request from a frame's payload.
///
/// # Errors
/// [`FrameError::Unknown`] or [`FrameError::Payload`].
pub fn decode_request(payload: &[u8]) -> Result<Request<'_>, FrameError> {
    decode(payload, Request::COUNT)
}

/// Decodes a response from a frame's payload.
///
/// # Errors
/// [`FrameError::Unknown`] or [`FrameError::Payload`].
pub fn decode_response<'de, S: Deserialize<'de>>(payload: &'de [u8]) -> Result<Response<S>, FrameError> {
    decode(payload, Response::<S>::COUNT)
}

/// Decodes a message that must fill the payload exactly; `count` is the number of known tags.
fn decode<'de, T: Deserialize<'de>>(payload: &'de [u8], count: u32) -> Result<T, FrameError> {
    match postcard::take_from_bytes::<T>(payload) {
        Ok((message, [])) => Ok(message),
        Ok(_) => Err(FrameError::Payload),
        // postcard does not distinguish a wrong tag from wrong content.
        Err(_) => match postcard::take_from_bytes::<u32>(payload) {
            Ok((tag, _)) if tag >= count => Err(FrameError::Unknown),
            _ => Err(FrameError::Payload),
        },
    }
}
