//! Monte Carlo: many worlds, each driven for some hours, and what the estimator made of them.

use kou_estimator::health::{Cause, Causes, DtcStatus, Health};
use kou_estimator::{Estimate, Params, State, step};
use rayon::prelude::*;
use serde::Serialize;

use super::coverage::Looks;
use super::drive::PERIOD_S;
use super::noise::Noise;
use super::world::{Event, World};
use kou_identify::calibration::SensorClass;

/// What is common to the runs of a study.
#[derive(Debug, Clone)]
pub struct Setting {
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
    /// Standard deviation of the wear that machines have behind them when learning begins, rectangular; 0 for new ones.
    pub worn_sd: f64,
    /// Seed of the first run.
    pub seed: u64,
}

/// Hours driven before an event.
pub const COMMISSIONING_H: f64 = 3.0;

/// What is to happen to worlds that have been driven for [`COMMISSIONING_H`].
#[derive(Debug, Clone)]
pub struct Course {
    /// What happens.
    pub event: Event,
    /// Hours driven after it.
    pub hours: f64,
    /// Whether a run ends with its first report: what follows is not of interest.
    pub until_report: bool,
    /// The cause that a diagnosis must not rule out.
    pub cause: Cause,
}

/// What one run came to.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Run {
    /// Changes reported before the event, or at all where there was none.
    pub false_changes: u32,
    /// Wear confirmed before the event, or at all where there was none.
    pub false_wear: bool,
    /// Seconds of driving with a valid coefficient seen, from the event to the first report.
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
    /// The interval of the level.
    pub level: Looks,
    /// The interval of the coefficient seen.
    pub kou: Looks,
    /// Sum of squared errors of the level, over the looks at it.
    pub level_error2: f64,
    /// Error of the level over its standard error, at the last look.
    pub level_error_in_se: Option<f64>,
    /// Seconds with a valid coefficient seen.
    pub judged_s: f64,
    /// Seconds of these with the gate open.
    pub gate_open_s: f64,
}

/// A world on its way.
#[derive(Debug, Clone)]
struct Journey {
    world: World,
    state: State,
    run: Run,
    samples: u64,
    changes: u16,
    /// Seconds with a valid coefficient since the event.
    since_event_s: f64,
    causes: Causes,
}

impl Setting {
    /// Drives one world for `hours` in which nothing happens.
    #[must_use]
    pub fn run(&self, number: u64, hours: f64) -> Run {
        let mut journey = self.start(number);
        journey.drive(self, hours, None);
        journey.end()
    }

    /// Drives `runs` worlds on all cores.
    #[must_use]
    pub fn runs(&self, runs: u64, hours: f64) -> Vec<Run> {
        (0..runs).into_par_iter().map(|number| self.run(number, hours)).collect()
    }

    /// Drives `runs` worlds for [`COMMISSIONING_H`], then each on every course, as if it alone had happened. The runs of
    /// each course.
    #[must_use]
    pub fn courses(&self, runs: u64, courses: &[Course]) -> Vec<Vec<Run>> {
        let by_world: Vec<Vec<Run>> = (0..runs)
            .into_par_iter()
            .map(|number| {
                let mut begun = self.start(number);
                begun.drive(self, COMMISSIONING_H, None);
                courses
                    .par_iter()
                    .map(|course| {
                        let mut journey = begun.clone();
                        journey.world.schedule(COMMISSIONING_H * 3600.0, course.event.clone());
                        journey.drive(self, course.hours, Some(course));
                        journey.end()
                    })
                    .collect()
            })
            .collect();
        (0..courses.len())
            .map(|i| by_world.iter().filter_map(|runs| runs.get(i).cloned()).collect())
            .collect()
    }

    fn start(&self, number: u64) -> Journey {
        let seed = self.seed + number;
        let mut world = World::new(&self.params, self.limits, self.class, self.misfit, seed);
        world.age_oil(self.oil_ageing_per_h);
        if self.worn_sd > 0.0 {
            world.begin_at(1.0 + Noise::new(!seed).within(3.0_f64.sqrt() * self.worn_sd));
        }
        Journey {
            world,
            state: State::new(),
            run: Run::default(),
            samples: 0,
            changes: 0,
            since_event_s: 0.0,
            causes: Causes::none(),
        }
    }
}

impl Journey {
    fn drive(&mut self, setting: &Setting, hours: f64, course: Option<&Course>) {
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "hours are positive and few"
        )]
        let samples = (hours * 3600.0 / PERIOD_S) as u64;
        for _ in 0..samples {
            let (sample, kou_true) = self.world.advance();
            let estimate = step(&setting.params, &mut self.state, &sample);
            self.judge(&estimate, course);
            self.samples += 1;
            // Once a minute.
            if course.is_none() && self.samples.is_multiple_of(1200) {
                let point = self.world.normalised(&sample);
                self.run.look(self.world.time_s(), point, &estimate, self.world.level(), kou_true);
            }
            if course.is_some_and(|c| c.until_report) && self.run.delay_s.is_some() {
                break;
            }
        }
    }

    fn judge(&mut self, estimate: &Estimate, course: Option<&Course>) {
        let (health, run) = (&estimate.health, &mut self.run);
        if estimate.observed.is_ok() {
            run.judged_s += PERIOD_S;
            run.gate_open_s += if health.gate.is_ok() { PERIOD_S } else { 0.0 };
            self.since_event_s += if course.is_some() { PERIOD_S } else { 0.0 };
        }
        let wear = health.wear == DtcStatus::Confirmed;
        self.causes = health.causes;
        if let Some(course) = course {
            run.wear |= wear;
            run.sensor |= health.sensor == DtcStatus::Confirmed;
            run.misled |= health.causes != Causes::none() && !health.causes.iter().any(|c| c == course.cause);
        } else {
            run.false_wear |= wear;
        }
        if health.changes > self.changes {
            self.changes = health.changes;
            if course.is_none() {
                run.false_changes += 1;
            } else if run.delay_s.is_none() {
                run.delay_s = Some(self.since_event_s);
                run.level_at_report = Some(self.world.level());
            }
        }
    }

    fn end(mut self) -> Run {
        self.run.remaining = self.causes.iter().map(Cause::name).collect();
        self.run
    }
}

impl Run {
    fn look(&mut self, time_s: f64, point: Option<[f64; 3]>, estimate: &Estimate, level: f64, kou_true: f64) {
        let (Ok(seen), Some(point)) = (estimate.observed, point) else { return };
        let within = |error: f64, se: f64| error.abs() <= 1.96 * se;
        let time_h = time_s / 3600.0;
        let error = f64::from(seen.kou.get()) - kou_true;
        self.kou.takes(time_h, point, within(error, seen.kou_se.get().into()));
        let health: &Health = &estimate.health;
        let (error, se) = (f64::from(health.level.get()) - level, f64::from(health.level_se.get()));
        self.level.takes(time_h, point, within(error, se));
        self.level_error2 += error * error;
        self.level_error_in_se = Some(error / se);
    }
}

/// Value below which a share of the values lies; runs without a value count as infinite and give nothing.
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
