//! Estimate: result of one step, each part valid or with the reason why not.

use serde::{Deserialize, Serialize};

use crate::health::Health;
use crate::reason::Reason;
use crate::units::{LeakageCoefficient, LitrePerMin, Micros, Ratio};

/// Leakage expected at the operating point, by the calibrated law and the flow balance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Expected {
    /// Leakage coefficient by the law.
    pub kou: LeakageCoefficient,
    /// Standard error of `kou`: the law's misfit and the uncertainty of its coefficients at this operating point.
    pub kou_se: LeakageCoefficient,
    /// Speed ratio `n_m/n_p` by the reduced model; negative for negative displacement.
    pub ratio: Ratio,
    /// Volumetric efficiency `r*D_m/(alpha*D_p)`.
    pub volumetric_efficiency: Ratio,
    /// Leakage flow to the case of all chambers together, at high pressure.
    pub leakage: LitrePerMin,
}

/// Leakage observed: the coefficient that explains the measured speed ratio.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Observed {
    /// Measured speed ratio; of a flow meter, its flow over the flow of its reference displacement at pump speed.
    pub ratio: Ratio,
    /// Leakage coefficient that explains the measured ratio, by the inverse of the flow balance.
    pub kou: LeakageCoefficient,
    /// Standard error of `kou` from the sensors' standard errors, to first order.
    pub kou_se: LeakageCoefficient,
    /// Measured volumetric efficiency.
    pub volumetric_efficiency: Ratio,
    /// Leakage flow to the case of all chambers together, at high pressure.
    pub leakage: LitrePerMin,
}

/// One estimate: expected and observed leakage, each valid or with its reason, and the health status.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Estimate {
    /// Time of the sample from which the estimate was made.
    pub time: Micros,
    /// Leakage by law and flow balance.
    pub expected: Result<Expected, Reason>,
    /// Leakage by the measured speed ratio.
    pub observed: Result<Observed, Reason>,
    /// Health status, whether or not this sample is valid.
    pub health: Health,
}

impl Estimate {
    /// Estimate without a valid part, for one reason, before anything was learned.
    #[must_use]
    pub const fn invalid(time: Micros, reason: Reason) -> Self {
        Self { time, expected: Err(reason), observed: Err(reason), health: Health::new() }
    }

    /// Wear ratio: observed over expected leakage coefficient. 1 for a machine as calibrated, rising with wear.
    ///
    /// # Errors
    /// The reason of the part that is not valid, the observed part first.
    pub fn wear_ratio(&self) -> Result<Ratio, Reason> {
        let observed = self.observed?;
        let expected = self.expected?;
        Ok(Ratio(observed.kou.get() / expected.kou.get()))
    }
}
