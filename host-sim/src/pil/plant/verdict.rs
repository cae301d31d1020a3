//! What the firmware said against what was true and what was expected.

use kou_app::controller::NoEstimate;
use kou_estimator::record::crc32;
use kou_estimator::{Estimate, Reason, Sample};
use serde::Serialize;

use super::scenario::{Expect, Scenario};
use super::vehicle::Truth;

/// One expectation and what came of it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// From then, s.
    pub from_s: f64,
    /// Until then, s.
    pub until_s: f64,
    /// What was expected.
    pub state: String,
    /// Outputs in that time, after the time that the state may take.
    pub outputs: u64,
    /// Outputs that were not as expected.
    pub others: u64,
    /// What they were, most often.
    pub instead: Option<String>,
    /// Time until the state first came, s; nothing when it never did.
    pub came_after_s: Option<f64>,
    /// Of `valid`: largest error of the coefficient over its stated standard error.
    pub worst_se: Option<f64>,
    /// Of `valid`: root mean square of the same.
    pub rms_se: Option<f64>,
    /// Of `valid`: mean error of the coefficient, percent of the truth.
    pub mean_error_pct: Option<f64>,
    /// Of `valid`: largest error of the coefficient, percent of the truth.
    pub worst_error_pct: Option<f64>,
    /// Of `valid`: largest error of the law's coefficient over its stated standard error.
    pub expected_worst_se: Option<f64>,
    /// Of `valid`: largest stated standard error of the coefficient, percent of the truth.
    pub largest_se_pct: Option<f64>,
    /// Of `valid`: outputs beyond the permitted number of standard errors.
    pub beyond: u64,
    /// Whether it was met.
    pub met: bool,
}

#[derive(Debug, Default)]
struct Tally {
    outputs: u64,
    others: u64,
    instead: Vec<(String, u64)>,
    came_after_s: Option<f64>,
    worst_se: f64,
    sum_se2: f64,
    sum_relative: f64,
    worst_relative: f64,
    expected_worst_se: f64,
    largest_se: f64,
    beyond: u64,
    compared: u64,
}

/// Judges outputs as they come.
#[derive(Debug)]
pub struct Verdict {
    expects: Vec<(Expect, Tally)>,
    outputs: u64,
    valid: u64,
    crc: u32,
}

/// Name of what an output says of the coefficient seen: `valid`, or the reason as reports print it.
#[must_use]
pub fn name_of(output: &Result<Estimate, NoEstimate>) -> String {
    match output {
        Err(NoEstimate::Starting) => "starting".into(),
        Err(NoEstimate::NoCalibration) => "no_calibration".into(),
        Err(NoEstimate::Late) => "late".into(),
        Ok(estimate) => match estimate.observed {
            Ok(_) => "valid".into(),
            Err(Reason::Sensor(channel, fault)) => format!("{} {}", channel.name(), fault.name()),
            Err(reason) => reason.name().into(),
        },
    }
}

impl Verdict {
    /// Of a scenario.
    #[must_use]
    pub fn new(scenario: &Scenario) -> Self {
        let expects = scenario.expects.iter().map(|expect| (expect.clone(), Tally::default())).collect();
        Self { expects, outputs: 0, valid: 0, crc: 0 }
    }

    /// Takes one output.
    pub fn judge(
        &mut self,
        time_s: f64,
        truth: &Truth,
        output: &Result<Estimate, NoEstimate>,
        sample: Option<&Sample>,
    ) {
        let mut bytes = self.crc.to_le_bytes().to_vec();
        let mut buffer = [0; 512];
        if let Ok(encoded) = postcard::to_slice(&(output, sample), &mut buffer) {
            bytes.extend_from_slice(encoded);
        }
        self.crc = crc32(&bytes);
        self.outputs += 1;
        let name = name_of(output);
        let seen = output.as_ref().ok().and_then(|estimate| estimate.observed.ok());
        self.valid += u64::from(seen.is_some());
        for (expect, tally) in &mut self.expects {
            if time_s < expect.from_s || time_s > expect.until_s {
                continue;
            }
            let fits = expect.state.split('|').any(|state| state.trim() == name);
            if fits && tally.came_after_s.is_none() {
                tally.came_after_s = Some(time_s - expect.from_s);
            }
            if time_s < expect.from_s + expect.after_s {
                continue;
            }
            tally.outputs += 1;
            if !fits {
                tally.others += 1;
                match tally.instead.iter_mut().find(|(other, _)| *other == name) {
                    Some((_, count)) => *count += 1,
                    None => tally.instead.push((name.clone(), 1)),
                }
            }
            if let (true, Some(seen), Ok(estimate)) = (name == "valid", seen, output) {
                let error = f64::from(seen.kou.get()) - truth.kou;
                let in_se = (error / f64::from(seen.kou_se.get())).abs();
                tally.compared += 1;
                tally.worst_se = tally.worst_se.max(in_se);
                tally.sum_se2 += in_se * in_se;
                let relative = error / truth.kou;
                tally.sum_relative += relative;
                tally.worst_relative = tally.worst_relative.max(relative.abs());
                tally.largest_se = tally.largest_se.max(f64::from(seen.kou_se.get()) / truth.kou);
                // Outside the law's region nothing is expected, which is no error.
                let of_law = estimate.expected.map_or(0.0, |law| {
                    ((f64::from(law.kou.get()) - truth.kou_unworn) / f64::from(law.kou_se.get())).abs()
                });
                tally.expected_worst_se = tally.expected_worst_se.max(of_law);
                let off = expect.within_pct.is_some_and(|pct| 100.0 * relative.abs() > pct);
                tally.beyond += u64::from(in_se.max(of_law) > expect.within_se || off);
            }
        }
    }

    /// Outputs taken.
    #[must_use]
    pub const fn outputs(&self) -> u64 {
        self.outputs
    }

    /// Outputs with a valid coefficient.
    #[must_use]
    pub const fn valid(&self) -> u64 {
        self.valid
    }

    /// CRC-32 over all outputs and samples.
    #[must_use]
    pub const fn crc32(&self) -> u32 {
        self.crc
    }

    /// What came of each expectation.
    #[must_use]
    pub fn findings(&self) -> Vec<Finding> {
        self.expects.iter().map(|(expect, tally)| finding(expect, tally)).collect()
    }
}

#[allow(clippy::cast_precision_loss, reason = "counts of a run are far below 2^52")]
fn finding(expect: &Expect, tally: &Tally) -> Finding {
    let compared = tally.compared as f64;
    let of_valid = |value: f64| (tally.compared > 0).then_some(value);
    let mean_pct = 100.0 * tally.sum_relative / compared;
    let is_centred = expect.mean_within_pct.is_none_or(|pct| tally.compared > 0 && mean_pct.abs() <= pct);
    let few_beyond = tally.beyond as f64 <= expect.may_miss * compared;
    Finding {
        from_s: expect.from_s,
        until_s: expect.until_s,
        state: expect.state.clone(),
        outputs: tally.outputs,
        others: tally.others,
        instead: tally.instead.iter().max_by_key(|(_, count)| *count).map(|(name, _)| name.clone()),
        came_after_s: tally.came_after_s,
        worst_se: of_valid(tally.worst_se),
        rms_se: of_valid((tally.sum_se2 / compared).sqrt()),
        mean_error_pct: of_valid(mean_pct),
        worst_error_pct: of_valid(100.0 * tally.worst_relative),
        expected_worst_se: of_valid(tally.expected_worst_se),
        largest_se_pct: of_valid(100.0 * tally.largest_se),
        beyond: tally.beyond,
        met: tally.outputs > 0 && tally.others == 0 && few_beyond && is_centred,
    }
}
