//! What a replay says about a whole log.

use std::collections::BTreeMap;

use kou_estimator::{Estimate, Reason};
use serde::Serialize;

/// Name of a reason with its channel or direction, for instance `p_h:open` or `outside_region:speed`.
#[must_use]
pub fn reason_label(reason: Reason) -> String {
    match reason {
        Reason::Sensor(channel, fault) => format!("{}:{}", channel.name(), fault.name()),
        Reason::OutsideRegion(direction) => format!("{}:{}", reason.name(), direction.name()),
        _ => reason.name().to_string(),
    }
}

/// Sums over the estimates of a log. A sample counts as accepted when both what is expected and what is seen are valid.
#[derive(Debug, Clone, Default)]
pub struct Summary {
    samples: u64,
    rejected: BTreeMap<String, u64>,
    accepted: u64,
    ratio_error_sum: f64,
    ratio_error_max: f64,
    kou_seen_sum: f64,
    kou_expected_sum: f64,
    wear_sum: f64,
}

/// The figures of a replay, as its JSON states them. Means are null when no sample was accepted.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Figures {
    /// Samples in the log.
    pub samples: u64,
    /// Samples with both parts valid.
    pub accepted: u64,
    /// Samples without, by reason.
    pub rejected: BTreeMap<String, u64>,
    /// Mean magnitude of expected minus measured ratio.
    pub ratio_error_mean: Option<f64>,
    /// Largest magnitude of expected minus measured ratio.
    pub ratio_error_max: Option<f64>,
    /// Mean coefficient seen, (L/min)/MPa.
    pub kou_mean: Option<f64>,
    /// Mean coefficient expected by the law, (L/min)/MPa.
    pub kou_law_mean: Option<f64>,
    /// Mean of coefficient seen over coefficient expected.
    pub wear_ratio_mean: Option<f64>,
}

impl Summary {
    /// Adds one estimate.
    pub fn add(&mut self, estimate: &Estimate) {
        self.samples += 1;
        match (estimate.wear_ratio(), estimate.expected, estimate.observed) {
            (Ok(wear), Ok(expected), Ok(seen)) => {
                self.accepted += 1;
                let error = f64::from(expected.ratio.get()) - f64::from(seen.ratio.get());
                self.ratio_error_sum += error.abs();
                self.ratio_error_max = self.ratio_error_max.max(error.abs());
                self.kou_seen_sum += f64::from(seen.kou.get());
                self.kou_expected_sum += f64::from(expected.kou.get());
                self.wear_sum += f64::from(wear.get());
            }
            (Err(reason), ..) | (_, Err(reason), _) | (.., Err(reason)) => {
                *self.rejected.entry(reason_label(reason)).or_default() += 1;
            }
        }
    }

    /// The figures so far.
    #[must_use]
    pub fn figures(&self) -> Figures {
        let mean = |sum: f64| (self.accepted > 0).then(|| sum / self.accepted as f64);
        Figures {
            samples: self.samples,
            accepted: self.accepted,
            rejected: self.rejected.clone(),
            ratio_error_mean: mean(self.ratio_error_sum),
            ratio_error_max: (self.accepted > 0).then_some(self.ratio_error_max),
            kou_mean: mean(self.kou_seen_sum),
            kou_law_mean: mean(self.kou_expected_sum),
            wear_ratio_mean: mean(self.wear_sum),
        }
    }
}
