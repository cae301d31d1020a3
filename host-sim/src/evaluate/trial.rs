//! Monte Carlo trials: many simulated drives of some hours each, and the estimator's results on them.

use kou_estimator::health::{Cause, Causes, DtcStatus, Health};
use kou_estimator::{Estimate, Params, State, step};
use rayon::prelude::*;
use serde::Serialize;

use super::coverage::CoverageCounts;
use super::duty_cycle::PERIOD_S;
use super::simulated_drive::{DriveEvent, SimulatedDrive};
use crate::noise::Noise;
use kou_identify::SensorClass;

/// Settings common to the trials of a study.
#[derive(Debug, Clone)]
pub struct TrialSettings {
    /// Checked calibration of the machine.
    pub params: Params,
    /// Normalisers of the law: largest speed, pressure, temperature.
    pub limits: [f64; 3],
    /// Class of the sensors.
    pub class: SensorClass,
    /// Misfit of the law, relative, 1 sigma over operating points.
    pub misfit: f64,
    /// Rise of leakage by ageing of the oil, per hour.
    pub oil_ageing_per_h: f64,
    /// Standard deviation of the machines' wear when learning begins, uniformly distributed; 0 for new ones.
    pub worn_sd: f64,
    /// Seed of the first trial.
    pub seed: u64,
}

/// Hours driven before an event.
pub const COMMISSIONING_H: f64 = 3.0;

/// Event of a trial after [`COMMISSIONING_H`], and how the trial goes on.
#[derive(Debug, Clone)]
pub struct TrialCase {
    /// Event.
    pub event: DriveEvent,
    /// Hours driven after it.
    pub hours: f64,
    /// Whether the trial ends with its first report.
    pub until_report: bool,
    /// The cause that a diagnosis must not rule out.
    pub cause: Cause,
}

/// Result of one trial.
#[derive(Debug, Clone, Default, Serialize)]
pub struct TrialResult {
    /// Changes reported before the event, or at all where there was none.
    pub false_changes: u32,
    /// Wear confirmed before the event, or at all where there was none.
    pub false_wear: bool,
    /// Seconds of driving with a valid observed coefficient, from the event to the first report.
    pub delay_s: Option<f64>,
    /// True level at the first report.
    pub level_at_report: Option<f64>,
    /// Whether wear was confirmed after the event.
    pub wear: bool,
    /// Whether a sensor, the displacement or the oil was blamed after the event.
    pub sensor: bool,
    /// Whether the diagnosis ever named causes without the true one.
    pub misled: bool,
    /// Causes that remained at the end.
    pub remaining: Vec<&'static str>,
    /// Coverage of the level's interval.
    pub level: CoverageCounts,
    /// Coverage of the observed coefficient's interval.
    pub kou: CoverageCounts,
    /// Sum of squared errors of the level, over its samples.
    pub level_error2: f64,
    /// Error of the level over its standard error, in the last sample.
    pub level_error_in_se: Option<f64>,
    /// Seconds with a valid observed coefficient.
    pub judged_s: f64,
    /// Seconds of these with the gate open.
    pub gate_open_s: f64,
}

/// A trial in progress.
#[derive(Debug, Clone)]
struct Trial {
    drive: SimulatedDrive,
    state: State,
    run: TrialResult,
    samples: u64,
    changes: u16,
    /// Seconds with a valid coefficient since the event.
    since_event_s: f64,
    causes: Causes,
}

impl TrialSettings {
    /// Runs one trial of `hours` without an event.
    #[must_use]
    pub fn run_healthy(&self, number: u64, hours: f64) -> TrialResult {
        let mut trial = self.start(number);
        trial.drive(self, hours, None);
        trial.end()
    }

    /// Runs trials without an event on all cores.
    #[must_use]
    pub fn run_healthy_many(&self, runs: u64, hours: f64) -> Vec<TrialResult> {
        (0..runs).into_par_iter().map(|number| self.run_healthy(number, hours)).collect()
    }

    /// Runs `runs` drives for [`COMMISSIONING_H`], then continues each with every case by itself. Returns the results by case.
    #[must_use]
    pub fn run_cases(&self, runs: u64, cases: &[TrialCase]) -> Vec<Vec<TrialResult>> {
        let by_drive: Vec<Vec<TrialResult>> = (0..runs)
            .into_par_iter()
            .map(|number| {
                let mut begun = self.start(number);
                begun.drive(self, COMMISSIONING_H, None);
                cases
                    .par_iter()
                    .map(|case| {
                        let mut trial = begun.clone();
                        trial.drive.schedule(COMMISSIONING_H * 3600.0, case.event.clone());
                        trial.drive(self, case.hours, Some(case));
                        trial.end()
                    })
                    .collect()
            })
            .collect();
        (0..cases.len()).map(|i| by_drive.iter().filter_map(|runs| runs.get(i).cloned()).collect()).collect()
    }

    fn start(&self, number: u64) -> Trial {
        let seed = self.seed + number;
        let mut drive = SimulatedDrive::new(&self.params, self.limits, self.class, self.misfit, seed);
        drive.age_oil(self.oil_ageing_per_h);
        if self.worn_sd > 0.0 {
            drive.start_at_level(1.0 + Noise::new(!seed).within(3.0_f64.sqrt() * self.worn_sd));
        }
        Trial {
            drive,
            state: State::new(),
            run: TrialResult::default(),
            samples: 0,
            changes: 0,
            since_event_s: 0.0,
            causes: Causes::none(),
        }
    }
}

impl Trial {
    fn drive(&mut self, settings: &TrialSettings, hours: f64, case: Option<&TrialCase>) {
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "hours are positive and few"
        )]
        let samples = (hours * 3600.0 / PERIOD_S) as u64;
        for _ in 0..samples {
            let (sample, kou_true) = self.drive.advance();
            let estimate = step(&settings.params, &mut self.state, &sample);
            self.assess(&estimate, case);
            self.samples += 1;
            // Once a minute.
            if case.is_none() && self.samples.is_multiple_of(1200) {
                let point = self.drive.normalised(&sample);
                self.run.look(self.drive.time_s(), point, &estimate, self.drive.level(), kou_true);
            }
            if case.is_some_and(|c| c.until_report) && self.run.delay_s.is_some() {
                break;
            }
        }
    }

    fn assess(&mut self, estimate: &Estimate, case: Option<&TrialCase>) {
        let (health, run) = (&estimate.health, &mut self.run);
        if estimate.observed.is_ok() {
            run.judged_s += PERIOD_S;
            run.gate_open_s += if health.gate.is_ok() { PERIOD_S } else { 0.0 };
            self.since_event_s += if case.is_some() { PERIOD_S } else { 0.0 };
        }
        let wear = health.wear == DtcStatus::Confirmed;
        self.causes = health.causes;
        if let Some(case) = case {
            run.wear |= wear;
            run.sensor |= health.sensor == DtcStatus::Confirmed;
            run.misled |= health.causes != Causes::none() && !health.causes.iter().any(|c| c == case.cause);
        } else {
            run.false_wear |= wear;
        }
        if health.changes > self.changes {
            self.changes = health.changes;
            if case.is_none() {
                run.false_changes += 1;
            } else if run.delay_s.is_none() {
                run.delay_s = Some(self.since_event_s);
                run.level_at_report = Some(self.drive.level());
            }
        }
    }

    fn end(mut self) -> TrialResult {
        self.run.remaining = self.causes.iter().map(Cause::name).collect();
        self.run
    }
}

impl TrialResult {
    fn look(&mut self, time_s: f64, point: Option<[f64; 3]>, estimate: &Estimate, level: f64, kou_true: f64) {
        let (Ok(seen), Some(point)) = (estimate.observed, point) else { return };
        let within = |error: f64, se: f64| error.abs() <= 1.96 * se;
        let time_h = time_s / 3600.0;
        let error = f64::from(seen.kou.get()) - kou_true;
        self.kou.push(time_h, point, within(error, seen.kou_se.get().into()));
        let health: &Health = &estimate.health;
        let (error, se) = (f64::from(health.level.get()) - level, f64::from(health.level_se.get()));
        self.level.push(time_h, point, within(error, se));
        self.level_error2 += error * error;
        self.level_error_in_se = Some(error / se);
    }
}

/// Quantile of the values of `of` trials: those without a value count as infinite, and give none.
#[must_use]
pub fn quantile(mut values: Vec<f64>, of: usize, share: f64) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "an index into at most a few thousand"
    )]
    let index = (share * (of.max(1) - 1) as f64).round() as usize;
    values.get(index).copied()
}
