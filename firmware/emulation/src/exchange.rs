//! Handover between an emulated controller and the host that emulates what is around it, once every millisecond.
//!
//! The firmware says what it wants of its hardware (SPI bytes to clock out) and what it tells; the host answers with the
//! bytes clocked in and the edges of the pickups. Besides, at any time, the flash: each operation is a message and its
//! answer, so that what was written outlasts a reset of the controller, and a supply that fails in the middle of it can be
//! emulated. One exchange is two messages in postcard's format, each behind its length in two bytes, little-endian. No board
//! on a vehicle uses it.

use heapless::Vec;
use kou_app::controller::{NoEstimate, TaskStatsSnapshot};
use kou_app::diagnostics::{CrashRecord, ResetCause};
use kou_app::sensors::pickup::MAX_EDGES;
use kou_app::sensors::set::CHANNELS;
use kou_estimator::{Estimate, Sample};
use serde::{Deserialize, Serialize};

/// Bytes before a message: its length.
pub const HEAD: usize = 2;
/// Longest message of either side, with its length.
pub const MAX_LEN: usize = 1024;
/// Frames of either direction in a millisecond: at 250 kbit/s a bus carries some two.
pub const MAX_CAN: usize = 8;

/// A CAN frame: identifier of 29 bits and data.
pub type CanFrame = (u32, Vec<u8, 8>);

/// Bytes of the emulated flash.
pub const FLASH_LEN: usize = 32 * 1024;
/// Bytes of its pages: those of an STM32G474 with two banks.
pub const FLASH_PAGE: usize = 2048;
/// Bytes that one operation reads or writes at most.
pub const FLASH_CHUNK: usize = 256;

/// How the controller begins: the first message, from the host.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EmulationStart<'a> {
    /// Record of the default calibration, as production would write it; empty for none.
    #[serde(borrow)]
    pub default: &'a [u8],
    /// The controller's key, as production would write it.
    pub key: Option<[u8; 32]>,
    /// Why it starts, as its hardware would tell.
    pub cause: ResetCause,
    /// What an earlier run left in memory that start-up leaves alone.
    pub crash_record: Option<CrashRecord>,
    /// Time between two writes of learned health and of the hours, s: scenarios are shorter than drives.
    pub write_period_s: u32,
}

/// An operation of the flash.
#[allow(clippy::large_enum_variant, reason = "there is one at a time, and no heap")]
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub enum FlashWork {
    /// Reads bytes, [`FLASH_CHUNK`] at most.
    Read {
        /// First byte.
        offset: u32,
        /// How many.
        length: u16,
    },
    /// Programs whole words.
    Write {
        /// First byte.
        offset: u32,
        /// What.
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

/// What came of it: bytes that were read, or nothing where the flash refused.
pub type FlashDone = Option<Vec<u8, FLASH_CHUNK>>;

/// A message from the firmware.
// One at a time: boxes are neither possible nor useful.
#[allow(clippy::large_enum_variant, reason = "there is one at a time, and no heap")]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum FirmwareMessage {
    /// A millisecond begins; the answer is [`TickReply`].
    Tick(TickReport),
    /// The flash is to do something; the answer is [`FlashDone`].
    Flash {
        /// Number of the record kind that is being written, for the host to aim at; nothing while records are read.
        of: Option<u8>,
        /// What.
        work: FlashWork,
    },
}

/// From the firmware, at the beginning of each millisecond.
// A message of the emulation, one at a time: boxes are neither possible nor useful.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TickReport {
    /// Number of this millisecond.
    pub tick: u32,
    /// Bytes that the converter's driver clocks out, one transaction for each fitted channel.
    pub spi: Vec<[u8; 3], CHANNELS>,
    /// What is told of leakage, every tenth time.
    pub output: Option<Result<Estimate, NoEstimate>>,
    /// The sample that the estimate was made of, every tenth time.
    pub sample: Option<Sample>,
    /// How the tasks are doing, every thousandth time: sample, estimate, publish, store, supervise.
    pub task_stats: Option<[TaskStatsSnapshot; 5]>,
    /// Deepest stack, with the task_stats.
    pub stack_bytes: u32,
    /// Turns in which the watchdog was fed.
    pub fed: u32,
    /// Number of the record kind that is being written to flash.
    pub writing: Option<u8>,
    /// Frames that were sent on the CAN bus.
    pub can: Vec<CanFrame, MAX_CAN>,
}

/// What the host may ask for besides.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Order {
    /// Go on.
    Run,
    /// End the emulation.
    Stop,
}

/// From the host.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TickReply {
    /// Bytes clocked in, for each of [`TickReport::spi`].
    pub spi: Vec<[u8; 3], CHANNELS>,
    /// The stamping timer's count.
    pub count: u32,
    /// Stamps of the pump's edges.
    pub pump: Vec<u32, MAX_EDGES>,
    /// Stamps of the motor's edges.
    pub motor: Vec<u32, MAX_EDGES>,
    /// Frames that came on the CAN bus.
    pub can: Vec<CanFrame, MAX_CAN>,
    /// What to do.
    pub order: Order,
}

/// Puts a message behind its length into `buffer`; the bytes to send, or nothing where it does not fit.
pub fn pack<'a>(message: &impl Serialize, buffer: &'a mut [u8]) -> Option<&'a [u8]> {
    let (head, body) = buffer.split_first_chunk_mut::<HEAD>()?;
    let length = postcard::to_slice(message, body).ok()?.len();
    *head = u16::try_from(length).ok()?.to_le_bytes();
    buffer.get(..HEAD.checked_add(length)?)
}

/// The message in `bytes`, when all of it is there; the number of bytes that it takes besides.
pub fn unpack<'a, T: Deserialize<'a>>(bytes: &'a [u8]) -> Option<(T, usize)> {
    let (head, rest) = bytes.split_first_chunk::<HEAD>()?;
    let length = usize::from(u16::from_le_bytes(*head));
    let message = postcard::from_bytes(rest.get(..length)?).ok()?;
    Some((message, HEAD.checked_add(length)?))
}
