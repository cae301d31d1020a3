//! Calibration that the controller uses, inferred from its outputs.
//!
//! The expected part of an output follows from sample and calibration alone, so the host computes it with every calibration
//! that may be in use and compares bits.

use kou_app::controller::NoEstimate;
use kou_estimator::{Calibration, Estimate, Expected, Params, Sample, State, step};
use serde::Serialize;

use super::service_tool::ServiceTool;

/// Counts of outputs by their calibration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct LawFinding {
    /// Outputs compared.
    pub compared: u64,
    /// Outputs of no calibration that could have been in use.
    pub foreign: u64,
    /// Changes from one calibration to another.
    pub swaps: u64,
    /// Calibration in use last: 0 for the default, else the number of the update.
    pub last: u64,
}

/// Tracker of the calibration in use.
#[derive(Debug)]
pub struct CalibrationTracker {
    default: Option<Params>,
    finding: LawFinding,
}

/// Whether the law of these parameters gives this output; its standard error may be wider while wear and a sensor fault cannot
/// be distinguished.
fn expects(params: &Params, sample: &Sample, output: &Estimate) -> bool {
    match (step(params, &mut State::new(), sample).expected, output.expected) {
        (Ok(own), Ok(reported)) => own == Expected { kou_se: own.kou_se, ..reported },
        (own, reported) => own == reported,
    }
}

impl CalibrationTracker {
    /// A tracker that begins with the default calibration.
    #[must_use]
    pub fn new(calibration: &Calibration) -> Self {
        Self { default: Params::new(calibration).ok(), finding: LawFinding::default() }
    }

    /// Adds an output.
    pub fn push(
        &mut self,
        output: &Result<Estimate, NoEstimate>,
        sample: Option<&Sample>,
        tool: &ServiceTool,
    ) {
        let (Ok(output), Some(sample)) = (output, sample) else { return };
        if output.expected.is_err() {
            return;
        }
        self.finding.compared += 1;
        let of_updates =
            tool.candidates().zip(1..).filter(|((_, may), _)| *may).map(|((params, _), n)| (params, n));
        let mut all = self.default.iter().map(|params| (params, 0)).chain(of_updates);
        match all.find(|(params, _)| expects(params, sample, output)) {
            None => self.finding.foreign += 1,
            Some((_, number)) => {
                self.finding.swaps += u64::from(number != self.finding.last);
                self.finding.last = number;
            }
        }
    }

    /// The counts.
    #[must_use]
    pub fn finding(&self) -> LawFinding {
        self.finding
    }
}
