//! Messages between an emulated controller and the host that emulates its hardware.
//!
//! Once per millisecond the firmware sends the bytes for its SPI bus, its outputs and its CAN frames; the host
//! replies with the bytes clocked in, the edges of the pickups and received frames. In addition, at any time, each
//! flash operation is a message with its answer, so that the flash content survives a reset of the controller and the
//! host can emulate a power failure in the middle of an operation. Every message is in postcard's format behind its
//! length in two bytes, little-endian.

use heapless::Vec;
use kou_app::controller::{NoEstimate, TaskStatsSnapshot};
use kou_app::diagnostics::{CrashRecord, ResetCause};
use kou_app::sensors::pickup::MAX_EDGES;
use kou_app::sensors::set::CHANNELS;
use kou_estimator::{Estimate, Sample};
use serde::{Deserialize, Serialize};

/// Bytes of the length before a message.
pub const HEAD: usize = 2;
/// Longest message in either direction, including its length.
pub const MAX_LEN: usize = 1024;
/// CAN frames per millisecond in either direction: at 250 kbit/s a bus carries about two.
pub const MAX_CAN: usize = 8;

/// CAN frame: 29-bit identifier and data.
pub type CanFrame = (u32, Vec<u8, 8>);

/// Size of the emulated flash in bytes.
pub const FLASH_LEN: usize = 32 * 1024;
/// Page size in bytes: that of an STM32G474 with two banks.
pub const FLASH_PAGE: usize = 2048;
/// Most bytes per read or write operation.
pub const FLASH_CHUNK: usize = 256;

/// First message, from the host: initial conditions of the controller.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EmulationStart<'a> {
    /// Record of the default calibration, as written by production; empty for none.
    #[serde(borrow)]
    pub default: &'a [u8],
    /// The controller's key, as written by production.
    pub key: Option<[u8; 32]>,
    /// Reset cause reported by the hardware.
    pub cause: ResetCause,
    /// Crash record left by an earlier run.
    pub crash_record: Option<CrashRecord>,
    /// Time between two writes of learned health and of the operating counters, s: scenarios are shorter than drives.
    pub write_period_s: u32,
}

/// Operation of the flash.
#[allow(clippy::large_enum_variant, reason = "there is one at a time, and no heap")]
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum FlashWork {
    /// Reads at most [`FLASH_CHUNK`] bytes.
    Read {
        /// First byte.
        offset: u32,
        /// Number of bytes.
        length: u16,
    },
    /// Programs whole words.
    Write {
        /// First byte.
        offset: u32,
        /// Data.
        bytes: Vec<u8, FLASH_CHUNK>,
    },
    /// Erases whole pages.
    Erase {
        /// First byte.
        from: u32,
        /// Byte behind the last.
        to: u32,
    },
}

/// Result of a flash operation: the bytes read, or `None` when the flash failed.
pub type FlashDone = Option<Vec<u8, FLASH_CHUNK>>;

/// Message from the firmware.
// One at a time: boxes are neither possible nor useful.
#[allow(clippy::large_enum_variant, reason = "there is one at a time, and no heap")]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum FirmwareMessage {
    /// Start of a millisecond; the reply is [`TickReply`].
    Tick(TickReport),
    /// Flash operation; the reply is [`FlashDone`].
    Flash {
        /// Number of the record kind that is being written, as a target for the host's faults; `None` during reads.
        of: Option<u8>,
        /// Operation.
        work: FlashWork,
    },
}

/// Report of the firmware at the start of each millisecond.
// One at a time: boxes are neither possible nor useful.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TickReport {
    /// Number of the millisecond.
    pub tick: u32,
    /// Bytes that the converter's driver clocks out, one transaction for each fitted channel.
    pub spi: Vec<[u8; 3], CHANNELS>,
    /// Published estimate, in every tenth report.
    pub output: Option<Result<Estimate, NoEstimate>>,
    /// Sample that the estimate was computed from, in every tenth report.
    pub sample: Option<Sample>,
    /// Timing statistics, in every thousandth report: sample, estimate, publish, storage, supervise.
    pub task_stats: Option<[TaskStatsSnapshot; 5]>,
    /// Deepest stack since start in bytes, with the statistics.
    pub stack_bytes: u32,
    /// Number of times that the watchdog was fed.
    pub fed: u32,
    /// Number of the record kind that is being written to flash.
    pub writing: Option<u8>,
    /// Frames sent on the CAN bus.
    pub can: Vec<CanFrame, MAX_CAN>,
}

/// Control of the run by the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Order {
    /// Continue.
    Run,
    /// End the emulation.
    Stop,
}

/// Reply of the host to a [`TickReport`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TickReply {
    /// Bytes clocked in, for each of [`TickReport::spi`].
    pub spi: Vec<[u8; 3], CHANNELS>,
    /// Count of the stamping timer.
    pub count: u32,
    /// Time stamps of the pump's edges.
    pub pump: Vec<u32, MAX_EDGES>,
    /// Time stamps of the motor's edges.
    pub motor: Vec<u32, MAX_EDGES>,
    /// Frames received from the CAN bus.
    pub can: Vec<CanFrame, MAX_CAN>,
    /// Control of the run.
    pub order: Order,
}

/// Encodes a message with its length into `buffer`; returns the bytes to send, or `None` when it does not fit.
pub fn pack<'a>(message: &impl Serialize, buffer: &'a mut [u8]) -> Option<&'a [u8]> {
    let (head, body) = buffer.split_first_chunk_mut::<HEAD>()?;
    let length = postcard::to_slice(message, body).ok()?.len();
    *head = u16::try_from(length).ok()?.to_le_bytes();
    buffer.get(..HEAD.checked_add(length)?)
}

/// Decodes a complete message at the start of `bytes`; also returns the number of bytes used.
pub fn unpack<'a, T: Deserialize<'a>>(bytes: &'a [u8]) -> Option<(T, usize)> {
    let (head, rest) = bytes.split_first_chunk::<HEAD>()?;
    let length = usize::from(u16::from_le_bytes(*head));
    let message = postcard::from_bytes(rest.get(..length)?).ok()?;
    Some((message, HEAD.checked_add(length)?))
}
