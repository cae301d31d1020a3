//! Reasons for rejecting a calibration update.

use core::fmt;

use serde::{Deserialize, Serialize};

/// Reason for rejecting an update or one of its steps. The number is part of the bus protocol and of the fault's SPN:
/// append only.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum RejectReason {
    /// Another tool's transfer is under way.
    Busy = 1,
    /// The drive is loaded, or its load is unknown.
    Loaded = 2,
    /// The controller has no key: no update is accepted.
    NoKey = 3,
    /// The counter is not above that of the last accepted update: possible replay.
    OldCounter = 4,
    /// Not the length of a calibration record.
    Length = 5,
    /// The segment is not the next one in order.
    OutOfOrder = 6,
    /// The tool did not continue the transfer in time.
    TimeOut = 7,
    /// The authentication tag does not match: wrong key, or altered data.
    Mac = 8,
    /// Not a calibration record that this version reads.
    Record = 9,
    /// A field of the record fails the estimator's checks.
    Field = 10,
    /// The record is for another machine.
    WrongMachine = 11,
    /// The flash could not store the record.
    Storage = 12,
    /// Commit before the last segment.
    Incomplete = 13,
    /// No transfer to which the command could belong.
    NoTransfer = 14,
    /// Command unknown to this version.
    Unknown = 15,
    /// No stored calibration to read.
    NothingStored = 16,
}

impl RejectReason {
    /// Every reason, in the order of the numbers.
    pub const ALL: [Self; 16] = [
        Self::Busy,
        Self::Loaded,
        Self::NoKey,
        Self::OldCounter,
        Self::Length,
        Self::OutOfOrder,
        Self::TimeOut,
        Self::Mac,
        Self::Record,
        Self::Field,
        Self::WrongMachine,
        Self::Storage,
        Self::Incomplete,
        Self::NoTransfer,
        Self::Unknown,
        Self::NothingStored,
    ];

    /// Number on the bus.
    #[must_use]
    pub const fn number(self) -> u8 {
        self as u8
    }

    /// Reason of a number.
    #[must_use]
    pub fn from_number(number: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|reason| reason.number() == number)
    }

    /// Name printed by tools.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Busy => "busy",
            Self::Loaded => "loaded",
            Self::NoKey => "no_key",
            Self::OldCounter => "old_counter",
            Self::Length => "length",
            Self::OutOfOrder => "out_of_order",
            Self::TimeOut => "time_out",
            Self::Mac => "mac",
            Self::Record => "record",
            Self::Field => "field",
            Self::WrongMachine => "wrong_machine",
            Self::Storage => "storage",
            Self::Incomplete => "incomplete",
            Self::NoTransfer => "no_transfer",
            Self::Unknown => "unknown",
            Self::NothingStored => "nothing_stored",
        }
    }
}

impl fmt::Display for RejectReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Busy => "another tool's transfer is under way",
            Self::Loaded => "the drive is loaded, or its load is unknown",
            Self::NoKey => "the controller has no key and accepts no update",
            Self::OldCounter => "the counter is not above that of the last accepted update",
            Self::Length => "no calibration record has this length",
            Self::OutOfOrder => "a segment is not the next one in order",
            Self::TimeOut => "the tool did not continue the transfer in time",
            Self::Mac => "the authentication tag does not match",
            Self::Record => "not a calibration record that this version reads",
            Self::Field => "a field of the calibration fails the estimator's checks",
            Self::WrongMachine => "the calibration is for another machine",
            Self::Storage => "the flash could not store the calibration",
            Self::Incomplete => "commit came before the last segment",
            Self::NoTransfer => "there is no transfer to which this belongs",
            Self::Unknown => "the command is not known to this version",
            Self::NothingStored => "there is no stored calibration to be read",
        })
    }
}

impl core::error::Error for RejectReason {}
