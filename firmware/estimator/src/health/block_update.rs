//! Hand-offs between the stages that process a block, stored from one sample to the next.

use serde::{Deserialize, Serialize};

use super::block_regression::{BlockRegression, DeviationSpread};
use super::diagnosis::CauseEvidence;
use super::fault_isolation::{LEAKAGE_SIGNATURES, OTHER_SIGNATURES};

/// Processing stage of the pending block.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ProcessingStage {
    /// No block is pending.
    Idle,
    /// Steadiness of pump speed and pressure.
    GateDrive,
    /// Steadiness of displacement and ratio residual.
    GateRatio,
    /// Regression model of the residual: law against measurement.
    Compare,
    /// Innovation against the learned parameters.
    Innovate,
    /// Cumulative sum: test for a step.
    TestStep,
    /// Start of the diagnosis of a step.
    ReportStep,
    /// Forgetting: growth of the level's variance.
    Forget,
    /// Measurement update of the parameters.
    Learn,
    /// Test for a drift.
    TestDrift,
    /// Start of the diagnosis of a drift.
    ReportDrift,
    /// Signatures of leakage and of the speed sensors.
    SignLeakage,
    /// Signatures of the other causes.
    SignOthers,
    /// Regression of the residual on the signatures.
    Regress,
    /// Evidence for each cause.
    Weigh,
    /// Possible causes and their consequence for the parameters.
    Conclude,
    /// Debouncing of the diagnostic faults.
    Debounce,
    /// Bounds of the parameters and trend of the level.
    Extrapolate,
    /// Publication of the health status.
    Publish,
}

/// Hand-offs of the pending block; each field is written by one stage and read by the stages named.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BlockUpdate {
    /// From `Compare` to all stages after it.
    pub regression: BlockRegression,
    /// Deviation in units of level: innovation, from `Innovate` to `TestStep` and `ReportStep`; once a drift is
    /// detected, distance from the reference, from `TestDrift` to `ReportDrift`.
    pub deviation: f32,
    /// From `Innovate` to `TestStep`.
    pub spread: DeviationSpread,
    /// Driving since the last used block, in hours, from `Compare` to `Forget`.
    pub hours: f32,
    /// From `SignLeakage` to `Regress`.
    pub leakage_signatures: [f32; LEAKAGE_SIGNATURES],
    /// From `SignOthers` to `Regress`.
    pub other_signatures: [f32; OTHER_SIGNATURES],
    /// Residual that the parameters before the last change leave, from `SignLeakage` to `Regress` and `Conclude`.
    pub unexplained: f32,
    /// From `Weigh` to `Conclude`.
    pub evidence: CauseEvidence,
}

impl BlockUpdate {
    /// Hand-offs before the first block.
    pub const fn new() -> Self {
        Self {
            regression: BlockRegression::new(),
            deviation: 0.0,
            spread: DeviationSpread::new(),
            hours: 0.0,
            leakage_signatures: [0.0; LEAKAGE_SIGNATURES],
            other_signatures: [0.0; OTHER_SIGNATURES],
            unexplained: 0.0,
            evidence: CauseEvidence::new(),
        }
    }
}
