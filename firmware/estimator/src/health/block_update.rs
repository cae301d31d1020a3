//! What is stored of a block between the stages that process it.

use serde::{Deserialize, Serialize};

use super::fault_isolation::{CAUSES, LEAKAGE_SIGNATURES, OTHER_SIGNATURES};
use super::ud_rls::PARAMETERS;

/// What is to be done with the block that waits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(super) enum Stage {
    /// No block waits.
    Idle,
    /// Are pump speed and pressure steady?
    GateDrive,
    /// Are displacement and the deficit of ratio?
    GateRest,
    /// What does the model say of it?
    Compare,
    /// What do the parameters leave unexplained?
    Innovate,
    /// Is that a step?
    Sum,
    /// It is: take note of the change.
    FoundStep,
    /// Forget a little.
    Forget,
    /// Learn from it.
    Learn,
    /// Has the level drifted?
    Watch,
    /// It has: take note of the change.
    FoundDrift,
    /// Signatures of leakage and of speed sensors, where there was a change.
    SignLeakage,
    /// Signatures of the other causes.
    SignOthers,
    /// Regression on them.
    Regress,
    /// Which causes remain?
    Explain,
    /// What follows from the causes.
    Conclude,
    /// Troubles.
    Count,
    /// Bounds and the trend of the level.
    Follow,
    /// What is to be told.
    Tell,
}

/// What the stages hand to each other.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(super) struct Used {
    /// Loss of ratio per unit of level.
    pub(super) per_level: f32,
    pub(super) phi: [f32; PARAMETERS],
    /// Variance of the deficit's noise, counted as if blocks were independent.
    pub(super) noise_variance: f32,
    /// Deficit that the parameters do not predict, or distance from the reference once a drift is found; what their
    /// uncertainty may have done to it (1 sigma), and the noise's variance, all in units of level.
    pub(super) error: f32,
    pub(super) learned_sd: f32,
    pub(super) noise2: f32,
    /// Judged driving since the block before, in hours.
    pub(super) hours: f32,
    pub(super) of_leakage: [f32; LEAKAGE_SIGNATURES],
    pub(super) of_others: [f32; OTHER_SIGNATURES],
    pub(super) unexplained: f32,
    /// What each cause explains of the deficits since the change, in units of chi-squared.
    pub(super) explained: [f32; CAUSES],
    /// Difference of that from which a cause is ruled out.
    pub(super) ruled_out: f32,
}

impl Used {
    /// No block so far.
    pub(super) const fn new() -> Self {
        Self {
            per_level: 0.0,
            phi: [0.0; PARAMETERS],
            noise_variance: 1.0,
            error: 0.0,
            learned_sd: 0.0,
            noise2: 1.0,
            hours: 0.0,
            of_leakage: [0.0; LEAKAGE_SIGNATURES],
            of_others: [0.0; OTHER_SIGNATURES],
            unexplained: 0.0,
            explained: [0.0; CAUSES],
            ruled_out: 0.0,
        }
    }
}
