//! Reasons for which a part of an estimate is not valid.

use serde::{Deserialize, Serialize};

use crate::model::calibrated_region::Direction;
use crate::reading::{Channel, Fault};

/// Reason for which a part of an estimate is not valid.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Reason {
    /// A channel has no valid value.
    Sensor(Channel, Fault),
    /// The sample is stamped earlier than the one before it.
    TimeReversed,
    /// The pump turns slower than `limits.min_pump_speed_rpm`.
    SpeedTooLow,
    /// The displacement is smaller than `limits.min_displacement`.
    DisplacementTooSmall,
    /// The pressure difference between the lines is below `limits.min_pressure_difference_mpa`.
    NotLoaded,
    /// The operating point lies outside the region in which the law was calibrated, in this direction.
    OutsideRegion(Direction),
    /// The law gives a coefficient that is not positive here.
    LawNotPositive,
    /// Leakage by the law would consume the whole flow: the motor would not turn.
    LeakageTakesFlow,
    /// The measured ratio has the wrong sign or is zero.
    RatioNotPositive,
    /// The measured ratio is above the leak-free ratio: no leakage explains it.
    RatioAboveLeakFree,
    /// The observed coefficient is above `limits.max_kou_l_min_mpa`: no plausible leakage explains the measured ratio.
    KouImplausible,
    /// Health monitoring attributes a change to a sensor, the displacement or the oil, not to leakage. Set by a
    /// controller from [`crate::health::Health`], never by a step of the estimator itself.
    SensorSuspected,
}

impl Reason {
    /// Name as reports print it; [`Channel::name`] and [`Fault::name`] add the details of a sensor's reason.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Sensor(..) => "sensor",
            Self::TimeReversed => "time_reversed",
            Self::SpeedTooLow => "speed_too_low",
            Self::DisplacementTooSmall => "displacement_too_small",
            Self::NotLoaded => "not_loaded",
            Self::OutsideRegion(_) => "outside_region",
            Self::LawNotPositive => "law_not_positive",
            Self::LeakageTakesFlow => "leakage_takes_flow",
            Self::RatioNotPositive => "ratio_not_positive",
            Self::RatioAboveLeakFree => "ratio_above_leak_free",
            Self::KouImplausible => "kou_implausible",
            Self::SensorSuspected => "sensor_suspected",
        }
    }
}
