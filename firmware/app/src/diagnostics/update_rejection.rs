//! Why an update, or a step of one, is refused.

use core::fmt;

use serde::{Deserialize, Serialize};

/// Why an update is refused. The number goes over the bus and into the trouble's SPN: append only.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum RejectReason {
    /// Another tool's transfer is under way.
    Busy = 1,
    /// The drive is loaded, or it is not known that it is not.
    Loaded = 2,
    /// The controller holds no key: it takes no update at all.
    NoKey = 3,
    /// The counter is not above that of the last accepted update: a replay.
    OldCounter = 4,
    /// No record has this length.
    Length = 5,
    /// A segment is not the one that is due.
    OutOfOrder = 6,
    /// The tool fell silent in the middle of a transfer.
    TimeOut = 7,
    /// The authentication tag does not match: wrong key, or something was changed on the way.
    Mac = 8,
    /// What came is no calibration record that this version reads.
    Record = 9,
    /// The record holds a field that the estimator's checks refuse.
    Field = 10,
    /// The record is for another machine.
    WrongMachine = 11,
    /// The flash did not take the record.
    Storage = 12,
    /// Commit came before the last segment.
    Incomplete = 13,
    /// There is no transfer that this could belong to.
    NoTransfer = 14,
    /// The command is not known to this version.
    Unknown = 15,
    /// There is no stored calibration to be read.
    NothingStored = 16,
}

impl RejectReason {
    /// Every refusal, in the order of its numbers.
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

    /// Its number on the bus.
    #[must_use]
    pub const fn number(self) -> u8 {
        self as u8
    }

    /// The refusal of this number.
    #[must_use]
    pub fn from_number(number: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|refusal| refusal.number() == number)
    }

    /// Name as tools print it.
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
            Self::Loaded => "the drive is loaded, or it is not known that it is not",
            Self::NoKey => "the controller holds no key and takes no update",
            Self::OldCounter => "the counter is not above that of the last accepted update",
            Self::Length => "no calibration record has this length",
            Self::OutOfOrder => "a segment is not the one that is due",
            Self::TimeOut => "the tool fell silent in the middle of the transfer",
            Self::Mac => "the authentication tag does not match",
            Self::Record => "not a calibration record that this version reads",
            Self::Field => "a field of the calibration is refused by the estimator's checks",
            Self::WrongMachine => "the calibration is for another machine",
            Self::Storage => "the flash did not take the calibration",
            Self::Incomplete => "commit came before the last segment",
            Self::NoTransfer => "there is no transfer that this belongs to",
            Self::Unknown => "the command is not known to this version",
            Self::NothingStored => "there is no stored calibration to be read",
        })
    }
}

impl core::error::Error for RejectReason {}
