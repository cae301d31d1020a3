//! Ratio and leakage over a log.

use std::collections::BTreeMap;

use kou_estimator::Estimate;
use serde::Serialize;

use super::labels::reason_label;

/// Sums over the estimates of a log. A sample counts as accepted when both its expected and its observed part are valid.
#[derive(Debug, Clone, Default)]
pub struct Summary {
    samples: u64,
    rejected: BTreeMap<String, u64>,
    accepted: u64,
    ratio_error_sum: f64,
    ratio_error_max: f64,
    kou_observed_sum: f64,
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
    /// Mean observed coefficient, (L/min)/MPa.
    pub kou_mean: Option<f64>,
    /// Mean coefficient expected by the law, (L/min)/MPa.
    pub kou_law_mean: Option<f64>,
    /// Mean ratio of observed to expected coefficient.
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
                self.kou_observed_sum += f64::from(seen.kou.get());
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
            kou_mean: mean(self.kou_observed_sum),
            kou_law_mean: mean(self.kou_expected_sum),
            wear_ratio_mean: mean(self.wear_sum),
        }
    }
}
