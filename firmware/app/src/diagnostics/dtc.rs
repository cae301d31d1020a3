//! Diagnostic faults and their trouble codes (DTC: SPN and FMI of SAE J1939-73).
//!
//! Fault and trouble code map one to one, so a memory of trouble codes remains readable whatever faults are added.
//! SPNs from 520192 on are reserved for manufacturers.

use kou_estimator::{Channel, Fault};
use serde::{Deserialize, Serialize};

use super::update_rejection::RejectReason;

/// First manufacturer-specific SPN of this controller.
const OWN: u32 = 520_192;
/// SPN of a rejected update minus the number of its reason.
const OWN_REJECTIONS: u32 = OWN + 16;

/// Diagnostic fault of the controller.
///
/// The host's reports print the variants by their `Debug` names.
#[doc(alias = "diagnostic fault")]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum FaultCode {
    /// Channel without a usable value. [`Fault::NotFitted`] is not a fault of this kind and has no code.
    Sensor(Channel, Fault),
    /// Increased leakage that only wear explains.
    Wear,
    /// Change that a sensor, the displacement or the oil explains.
    SensorSuspect,
    /// Rejected calibration update.
    UpdateRefused(RejectReason),
    /// Unreadable stored calibration; the default is in use.
    CalibrationLost,
    /// Failed read or write of the flash.
    StorageFailed,
    /// Supply voltage below its limit.
    BrownOut,
    /// Restart by the watchdog.
    Watchdog,
    /// Stop by the firmware itself.
    Panic,
    /// Missed deadline of a task.
    Overrun,
    /// No frame received for the bus timeout.
    BusSilent,
    /// Source address lost and no other one available.
    AddressLost,
}

/// Diagnostic trouble code: suspect parameter number (19 bits) and failure mode identifier (5 bits).
#[doc(alias = "diagnostic trouble code")]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Dtc {
    /// Suspect parameter number.
    pub spn: u32,
    /// Failure mode identifier.
    pub fmi: u8,
}

/// Lamp that an active fault lights.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lamp {
    /// None: recorded for the workshop only.
    None,
    /// Amber warning lamp: service needed, the drive is not disturbed.
    Amber,
}

impl FaultCode {
    /// Every fault, each once.
    pub fn all() -> impl Iterator<Item = Self> {
        let sensors = Channel::ALL.into_iter().flat_map(|channel| {
            Fault::ALL
                .into_iter()
                .filter(|fault| *fault != Fault::NotFitted)
                .map(move |fault| Self::Sensor(channel, fault))
        });
        let rejections = RejectReason::ALL.into_iter().map(Self::UpdateRefused);
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
        sensors.chain(rejections).chain(others)
    }

    /// Trouble code of the fault.
    #[must_use]
    pub const fn dtc(self) -> Dtc {
        let (spn, fmi) = match self {
            Self::Sensor(channel, fault) => (channel_spn(channel), fault_fmi(fault)),
            // Above normal, moderately severe.
            Self::Wear => (OWN, 16),
            // Out of calibration.
            Self::SensorSuspect => (OWN + 1, 13),
            // Condition exists.
            Self::UpdateRefused(reason) => (OWN_REJECTIONS + reason.number() as u32, 31),
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

    /// Fault of a trouble code; `None` for a code that this version does not know.
    #[must_use]
    pub fn from_dtc(dtc: Dtc) -> Option<Self> {
        Self::all().find(|code| code.dtc() == dtc)
    }

    /// Lamp lit while the fault is active.
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
        // Mechanical system not responding: the closest to a constant signal.
        Fault::Stuck => 7,
        // Abnormal update rate.
        Fault::Stale => 9,
        // Abnormal rate of change.
        Fault::Rate => 10,
        // Out of calibration: the closest to a value that other sensors contradict.
        Fault::Implausible => 13,
        // Bad intelligent device or component.
        Fault::NotFinite => 12,
        // Received network data in error: an impossible time stamp.
        Fault::Future => 19,
        // Condition exists.
        Fault::Missing => 31,
        // Root cause not known; never reported.
        Fault::NotFitted => 11,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_and_trouble_codes_map_one_to_one() {
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
