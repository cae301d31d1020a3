//! What host and firmware say to each other.
//!
//! Messages go over the wire in postcard's format, by the position of variants and fields: extend an enum by appending,
//! never reorder, and raise [`PROTOCOL`] when the meaning of an existing message changes. Texts are `S`: string literals
//! in the firmware, where nothing is allocated, and owned strings on the host.

use core::fmt;

use kou_estimator::calibration::record::RecordError;
use kou_estimator::{CalibrationError, Estimate, Problem, Sample};
use serde::{Deserialize, Serialize};

use super::frame::FrameError;

/// Version of the link's protocol, told by [`Response::Hello`]. 2: estimates carry health.
pub const PROTOCOL: u16 = 2;

/// What the host asks. Every request is answered by exactly one [`Response`], in order.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Request<'a> {
    /// Who is there? Answer: [`Response::Hello`].
    Hello,
    /// A calibration as its binary record; takes effect with its answer, [`Response::CalibrationAccepted`], and starts
    /// the estimator's state anew. Refused, it changes nothing.
    LoadCalibration(&'a [u8]),
    /// A sample to estimate from. Answer: [`Response::Estimate`], or [`ErrorKind::NoCalibration`].
    Sample(Sample),
    /// Answer: [`Response::Status`].
    Status,
    /// End the firmware, where it runs in an emulator; a board with nowhere to go restarts. Answer:
    /// [`Response::ShuttingDown`], the last one.
    Shutdown,
}

impl Request<'_> {
    /// Number of requests that this version knows.
    pub const COUNT: u32 = 5;
}

/// What the firmware answers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Response<S> {
    /// Who is there.
    Hello(Hello<S>),
    /// The calibration is in use.
    CalibrationAccepted {
        /// The record's own CRC-32, for the host to compare.
        crc: u32,
    },
    /// The calibration is not in use; the one before it, if any, still is.
    CalibrationRejected(CalibrationRejection<S>),
    /// The estimate for one sample.
    Estimate(Estimate),
    /// Counters and the like.
    Status(Status),
    /// The request was not obeyed.
    Error(ErrorKind),
    /// The firmware ends as soon as this is sent.
    ShuttingDown,
}

impl<S> Response<S> {
    /// Number of responses that this version knows.
    pub const COUNT: u32 = 7;
}

/// The firmware's identity.
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

/// Why a request was not obeyed. On the wire by position: append only.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ErrorKind {
    /// What arrived was not a request.
    Frame(FrameError),
    /// A sample came before any calibration.
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

/// Why a calibration is not used.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum CalibrationRejection<S> {
    /// The record cannot be read.
    Record(RecordError),
    /// A field of it is wrong.
    Field {
        /// Dotted name of the field as in the TOML form, for instance `oil.bulk_modulus_mpa`.
        field: S,
        /// What is wrong with it.
        problem: FieldProblem<S>,
    },
}

/// What is wrong with a field of a calibration: the estimator's [`Problem`] in a form that can cross the link.
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
    /// In range by itself, but contradicting another field.
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

/// The firmware's state as told to the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Status {
    /// Time since start by the firmware's own clock, in microseconds.
    pub uptime_us: u64,
    /// Deepest stack since start, in bytes.
    pub stack_high_water_bytes: u32,
    /// CRC-32 of the calibration record in use, if any.
    pub calibration: Option<u32>,
    /// What has happened so far.
    pub counts: LinkCounts,
}

/// What has happened since start. Each count stays at its maximum instead of wrapping.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct LinkCounts {
    /// Frames that held a request, this one included.
    pub frames_ok: u32,
    /// Frames refused as [`FrameError::TooLong`].
    pub frames_too_long: u32,
    /// Frames refused as [`FrameError::TooShort`].
    pub frames_too_short: u32,
    /// Frames refused as [`FrameError::Cobs`].
    pub frames_cobs: u32,
    /// Frames refused as [`FrameError::Crc`].
    pub frames_crc: u32,
    /// Frames refused as [`FrameError::Unknown`].
    pub frames_unknown: u32,
    /// Frames refused as [`FrameError::Payload`].
    pub frames_payload: u32,
    /// Samples received.
    pub samples: u32,
    /// Samples that came before any calibration.
    pub samples_without_calibration: u32,
    /// Estimates of which both parts were valid.
    pub estimates_valid: u32,
    /// Estimates of which a part was refused.
    pub estimates_rejected: u32,
    /// Calibrations taken into use.
    pub calibrations_accepted: u32,
    /// Calibrations refused.
    pub calibrations_rejected: u32,
    /// Beats of the heartbeat task.
    pub heartbeats: u32,
}

impl LinkCounts {
    /// Frames refused, of every kind together.
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

/// Reads a request from a frame's payload.
///
/// # Errors
/// [`FrameError::Unknown`] or [`FrameError::Payload`].
pub fn decode_request(payload: &[u8]) -> Result<Request<'_>, FrameError> {
    decode(payload, Request::COUNT)
}

/// Reads a response from a frame's payload.
///
/// # Errors
/// [`FrameError::Unknown`] or [`FrameError::Payload`].
pub fn decode_response<'de, S: Deserialize<'de>>(payload: &'de [u8]) -> Result<Response<S>, FrameError> {
    decode(payload, Response::<S>::COUNT)
}

/// Reads a message that must fill the payload exactly; `count` is the number of tags known.
fn decode<'de, T: Deserialize<'de>>(payload: &'de [u8], count: u32) -> Result<T, FrameError> {
    match postcard::take_from_bytes::<T>(payload) {
        Ok((message, [])) => Ok(message),
        Ok(_) => Err(FrameError::Payload),
        // postcard does not say whether the tag or what follows it was wrong.
        Err(_) => match postcard::take_from_bytes::<u32>(payload) {
            Ok((tag, _)) if tag >= count => Err(FrameError::Unknown),
            _ => Err(FrameError::Payload),
        },
    }
}
