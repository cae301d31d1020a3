//! Fault debounce by an up-down counter: per-sample results in, confirmed or healed faults out.
//!
//! The level rises by [`RISE`] with a bad sample and falls by one with a good one; at [`RISE`] times `confirm` the
//! fault is confirmed. An intermittent fault is therefore confirmed when more than one sample in five is bad, and a
//! single bad sample never is. A confirmed fault heals after `heal` consecutive good samples.

use kou_estimator::Fault;

use super::config::{ConfigError, integer};

/// Weight of a bad sample relative to a good one.
pub const RISE: u32 = 4;

/// Durations of confirmation and healing, in samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DebounceConfig {
    /// Consecutive bad samples that confirm a fault, 1 to 60 000.
    pub confirm: u32,
    /// Consecutive good samples that heal it, 1 to 60 000.
    pub heal: u32,
}

/// Checked limits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DebounceParams {
    config: DebounceConfig,
}

impl DebounceParams {
    /// Checks the limits.
    ///
    /// # Errors
    /// The limit out of range.
    pub fn new(config: &DebounceConfig) -> Result<Self, ConfigError> {
        integer("debounce.confirm", config.confirm, 1, 60_000)?;
        integer("debounce.heal", config.heal, 1, 60_000)?;
        Ok(Self { config: *config })
    }
}

/// State of a debounce: level and confirmed fault.
#[doc(alias = "fault counter")]
#[doc(alias = "up-down counter")]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct DebounceState {
    level: u32,
    good: u32,
    fault: Option<Fault>,
}

impl DebounceState {
    /// No fault.
    #[must_use]
    pub const fn new() -> Self {
        Self { level: 0, good: 0, fault: None }
    }

    /// Confirmed fault.
    #[must_use]
    pub const fn fault(&self) -> Option<Fault> {
        self.fault
    }

    /// Updates with the result of one sample; returns true when a fault has just been confirmed.
    pub fn update(&mut self, params: &DebounceParams, judgement: Result<(), Fault>) -> bool {
        let DebounceConfig { confirm, heal } = params.config;
        match judgement {
            Ok(()) => {
                self.level = self.level.saturating_sub(1);
                self.good = self.good.saturating_add(1).min(heal);
                if self.fault.is_some() && self.good >= heal {
                    *self = Self::new();
                }
                false
            }
            Err(fault) => {
                self.good = 0;
                let top = RISE.saturating_mul(confirm);
                self.level = self.level.saturating_add(RISE).min(top);
                let fresh = self.fault.is_none() && self.level >= top;
                if fresh || self.fault.is_some() {
                    // A confirmed fault takes its latest name: an open wire may become shorted.
                    self.fault = Some(fault);
                }
                fresh
            }
        }
    }
}
