//! What one step of the estimator says, and why it says nothing where it cannot.

use serde::{Deserialize, Serialize};

use crate::health::Health;
use crate::reason::Reason;
use crate::units::{LeakageCoefficient, LitrePerMin, Micros, Ratio};

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
