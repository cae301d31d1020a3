//! What one step of the estimator says, and why it says nothing where it cannot.

use serde::{Deserialize, Serialize};

use crate::health::Health;
use crate::reading::{Channel, Fault};
use crate::region::Direction;
use crate::units::{LeakageCoefficient, LitrePerMin, Micros, Ratio};

/// Why a part of an estimate is not valid.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Reason {
    /// A channel has no usable value.
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
    /// Leakage by the law would take the whole flow: the motor would stand still.
    LeakageTakesFlow,
    /// The measured ratio has the wrong sign or is zero.
    RatioNotPositive,
    /// The measured ratio is above the leak-free ratio: no leakage explains it.
    RatioAboveLeakFree,
    /// The coefficient seen is above `limits.max_kou`: no plausible leakage explains the measured ratio.
    KouImplausible,
    /// What was learned while driving says that a sensor, the displacement or the oil has changed, not the leakage. No
    /// step of the estimator says so by itself: a controller does, from [`Health`].
    SensorSuspected,
}

impl Reason {
    /// Name as reports print it; a sensor's reason is told by [`Channel::name`] and [`Fault::name`] besides.
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

/// What the calibrated law and the reduced model expect at the present operating point.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Expected {
    /// Leakage coefficient by the law.
    pub kou: LeakageCoefficient,
    /// Standard error of `kou`: the law's misfit and the errors of its coefficients at this operating point.
    pub kou_se: LeakageCoefficient,
    /// Speed ratio `n_m/n_p` by the reduced model; negative for negative displacement.
    pub ratio: Ratio,
    /// Volumetric efficiency `r*D_m/(alpha*D_p)`.
    pub volumetric_efficiency: Ratio,
    /// Leakage flow to the case of all chambers together, at high pressure.
    pub leakage: LitrePerMin,
}

/// What the measured ratio says about leakage.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Seen {
    /// Measured speed ratio; of a flow meter, its flow over what its reference displacement would pass.
    pub ratio: Ratio,
    /// Leakage coefficient that explains the measured ratio, by the reduced model's inverse.
    pub kou: LeakageCoefficient,
    /// Standard error of `kou` from the sensors' standard errors, to first order.
    pub kou_se: LeakageCoefficient,
    /// Measured volumetric efficiency.
    pub volumetric_efficiency: Ratio,
    /// Leakage flow to the case of all chambers together, at high pressure.
    pub leakage: LitrePerMin,
}

/// One estimate: what is expected and what is seen, each valid or with its reason, and what has been learned.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Estimate {
    /// Time of the sample from which the estimate was made.
    pub time: Micros,
    /// By law and reduced model.
    pub expected: Result<Expected, Reason>,
    /// By the measured ratio.
    pub seen: Result<Seen, Reason>,
    /// What has been learned so far, whatever this sample was like.
    pub health: Health,
}

impl Estimate {
    /// An estimate of which no part is valid, for one reason, before anything was learned.
    #[must_use]
    pub const fn invalid(time: Micros, reason: Reason) -> Self {
        Self { time, expected: Err(reason), seen: Err(reason), health: Health::new() }
    }

    /// Coefficient seen over coefficient expected: 1 for a machine as it was when calibrated, rising with wear.
    ///
    /// # Errors
    /// The reason of the part that is not valid; of what is seen first.
    pub fn wear_ratio(&self) -> Result<Ratio, Reason> {
        let seen = self.seen?;
        let expected = self.expected?;
        Ok(Ratio(seen.kou.get() / expected.kou.get()))
    }
}
