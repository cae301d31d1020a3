//! What can go wrong, and the trouble code (SPN and FMI of J1939-73) that says so.
//!
//! Code and trouble code belong to each other one to one, so a memory written as trouble codes is read again whatever
//! has been added since. SPNs from 520192 on are free for the manufacturer.

use kou_estimator::{Channel, Fault};
use serde::{Deserialize, Serialize};

use super::update_rejection::RejectReason;

/// First SPN of the controller's own.
const OWN: u32 = 520_192;
/// SPN of a refused update, less the number of the refusal.
const OWN_REFUSALS: u32 = OWN + 16;

/// Something that can go wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum FaultCode {
    /// A channel has no usable value. [`Fault::NotFitted`] is no trouble and has no code.
    Sensor(Channel, Fault),
    /// The machine leaks more than it did, and nothing but leakage explains it.
    Wear,
    /// A sensor, the displacement or the oil explains a change of what is seen.
    SensorSuspect,
    /// A calibration update was refused.
    UpdateRefused(RejectReason),
    /// The stored calibration could not be read; the default is in use.
    CalibrationLost,
    /// The flash refused to be written or read.
    StorageFailed,
    /// The supply fell below its limit.
    BrownOut,
    /// The watchdog restarted the controller.
    Watchdog,
    /// The firmware stopped itself.
    Panic,
    /// A task missed its deadline.
    Overrun,
    /// No frame came from the bus for its time-out.
    BusSilent,
    /// The source address was lost and no other is left.
    AddressLost,
}

/// A trouble code: suspect parameter number (19 bits) and failure mode identifier (5 bits).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Dtc {
    /// What.
    pub spn: u32,
    /// In which way.
    pub fmi: u8,
}

/// The lamp that a trouble lights.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lamp {
    /// None: recorded for the workshop.
    None,
    /// Amber warning lamp: to be looked at; the drive is not disturbed.
    Amber,
}

impl FaultCode {
    /// Every code, each once.
    pub fn all() -> impl Iterator<Item = Self> {
        let sensors = Channel::ALL.into_iter().flat_map(|channel| {
            Fault::ALL
                .into_iter()
                .filter(|fault| *fault != Fault::NotFitted)
                .map(move |fault| Self::Sensor(channel, fault))
        });
        let refusals = RejectReason::ALL.into_iter().map(Self::UpdateRefused);
        let others = [
            Self::Wear,
            Self::SensorSuspect,
            Self::CalibrationLost,
            Self::StorageFailed,
            Self::BrownOut,
            Self::Watchdog,
            Self::Panic,
            Self::Overrun,
            Self::BusSilent,
            Self::AddressLost,
        ];
        sensors.chain(refusals).chain(others)
    }

    /// Its trouble code.
    #[must_use]
    pub const fn dtc(self) -> Dtc {
        let (spn, fmi) = match self {
            Self::Sensor(channel, fault) => (channel_spn(channel), fault_fmi(fault)),
            // Above normal, moderately severe.
            Self::Wear => (OWN, 16),
            // Out of calibration.
            Self::SensorSuspect => (OWN + 1, 13),
            // Condition exists.
            Self::UpdateRefused(refusal) => (OWN_REFUSALS + refusal.number() as u32, 31),
            // Calibration memory: out of calibration, and failed.
            Self::CalibrationLost => (630, 13),
            Self::StorageFailed => (630, 12),
            // Supply: voltage below normal.
            Self::BrownOut => (168, 4),
            // Controller 1: root cause not known, failed, abnormal update rate.
            Self::Watchdog => (629, 11),
            Self::Panic => (629, 12),
            Self::Overrun => (629, 9),
            // J1939 network 1: abnormal update rate, special instructions.
            Self::BusSilent => (639, 9),
            Self::AddressLost => (639, 14),
        };
        Dtc { spn, fmi }
    }

    /// The code of a trouble code; nothing when this version knows none.
    #[must_use]
    pub fn from_dtc(dtc: Dtc) -> Option<Self> {
        Self::all().find(|code| code.dtc() == dtc)
    }

    /// The lamp that it lights while it is active.
    #[must_use]
    pub const fn lamp(self) -> Lamp {
        match self {
            Self::Sensor(..)
            | Self::Wear
            | Self::SensorSuspect
            | Self::CalibrationLost
            | Self::StorageFailed
            | Self::BusSilent => Lamp::Amber,
            Self::UpdateRefused(_)
            | Self::BrownOut
            | Self::Watchdog
            | Self::Panic
            | Self::Overrun
            | Self::AddressLost => Lamp::None,
        }
    }
}

const fn channel_spn(channel: Channel) -> u32 {
    match channel {
        Channel::PumpSpeed => 161,
        Channel::MotorSpeed => 191,
        Channel::HighPressure => 1762,
        Channel::OilTemperature => 177,
        Channel::LowPressure => OWN + 2,
        Channel::Displacement => OWN + 3,
        Channel::Flow => OWN + 4,
    }
}

const fn fault_fmi(fault: Fault) -> u8 {
    match fault {
        // Data erratic, intermittent or incorrect.
        Fault::OutOfRange => 2,
        // Current below normal or open circuit.
        Fault::Open => 5,
        // Current above normal or grounded circuit.
        Fault::Short => 6,
        // Mechanical system not responding: the nearest to a signal that stands still.
        Fault::Stuck => 7,
        // Abnormal update rate.
        Fault::Stale => 9,
        // Abnormal rate of change.
        Fault::Rate => 10,
        // Out of calibration: the nearest to a value that the other sensors contradict.
        Fault::Implausible => 13,
        // Bad intelligent device or component.
        Fault::NotFinite => 12,
        // Received network data in error: a time stamp that cannot be.
        Fault::Future => 19,
        // Condition exists.
        Fault::Missing => 31,
        // Root cause not known; no trouble is ever reported with it.
        Fault::NotFitted => 11,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_and_trouble_codes_belong_to_each_other_one_to_one() {
        let mut count = 0;
        for code in FaultCode::all() {
            let dtc = code.dtc();
            assert!(dtc.spn > 0 && dtc.spn < 1 << 19 && dtc.fmi < 32, "{code:?}");
            assert_eq!(FaultCode::from_dtc(dtc), Some(code), "two codes share {dtc:?}");
            count += 1;
        }
        assert_eq!(count, Channel::ALL.len() * (Fault::ALL.len() - 1) + RejectReason::ALL.len() + 10);
        assert_eq!(FaultCode::from_dtc(Dtc { spn: 161, fmi: 11 }), None);
    }
}
