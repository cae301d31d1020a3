//! Monte Carlo: many worlds, each driven for some hours, and what the estimator made of them.

use kou_estimator::health::{Cause, Health, Stage};
use kou_estimator::{Estimate, Params, State, step};
use rayon::prelude::*;
use serde::Serialize;

use super::drive::PERIOD_S;
use super::world::{Event, World};
use crate::calibration::SensorClass;

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
    /// Seed of the first run.
    pub seed: u64,
}

/// Hours driven before an event.
pub const COMMISSIONING_H: f64 = 3.0;

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
    /// Causes that remained at the end.
    pub remaining: Vec<&'static str>,
    /// Times at which the interval of the level was looked at, and those at which it held the truth.
    pub level_looks: u32,
    /// See `level_looks`.
    pub level_hits: u32,
    /// The same for the coefficient seen.
    pub kou_looks: u32,
    /// See `kou_looks`.
    pub kou_hits: u32,
    /// Sum of squared errors of the level.
    pub level_error2: f64,
    /// Error of the level over its standard error, at the last look.
    pub level_error_in_se: Option<f64>,
    /// Seconds with a valid coefficient seen.
    pub judged_s: f64,
    /// Seconds of these with the gate open.
    pub gate_open_s: f64,
}

impl Setting {
    /// Drives one world for `hours`; the event, if any, comes after [`COMMISSIONING_H`].
    #[must_use]
    pub fn run(&self, number: u64, hours: f64, event: Option<Event>) -> Run {
        let event_s = COMMISSIONING_H * 3600.0;
        let mut world = World::new(&self.params, self.limits, self.class, self.misfit, self.seed + number);
        world.age_oil(self.oil_ageing_per_h);
        if let Some(event) = event {
            world.schedule(event_s, event);
        }
        let mut state = State::new();
        let mut run = Run::default();
        let (mut changes, mut judged_s) = (0, 0.0);
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "hours are positive and few"
        )]
        let samples = (hours * 3600.0 / PERIOD_S) as u64;
        for i in 0..samples {
            let (sample, kou_true) = world.advance();
            let estimate = step(&self.params, &mut state, &sample);
            let health = estimate.health;
            let after = event.is_some() && world.time_s() > event_s;
            judged_s += if after && estimate.seen.is_ok() { PERIOD_S } else { 0.0 };
            if estimate.seen.is_ok() {
                run.judged_s += PERIOD_S;
                run.gate_open_s += if health.gate.is_ok() { PERIOD_S } else { 0.0 };
            }
            if health.changes > changes {
                changes = health.changes;
                if !after {
                    run.false_changes += 1;
                } else if run.delay_s.is_none() {
                    run.delay_s = Some(judged_s);
                    run.level_at_report = Some(world.level());
                }
            }
            let wear = health.wear == Stage::Confirmed;
            if after {
                run.wear |= wear;
                run.sensor |= health.sensor == Stage::Confirmed;
            } else {
                run.false_wear |= wear;
            }
            // Once a minute, and not in the first hour, in which level and offset are still being told apart.
            if i % 1200 == 0 && (event.is_none() || !after) {
                run.look(world.time_s(), &estimate, &health, world.level(), kou_true);
            }
            if i + 1 == samples {
                run.remaining = health.causes.iter().map(Cause::name).collect();
            }
        }
        run
    }

    /// Drives `runs` worlds on all cores.
    #[must_use]
    pub fn runs(&self, runs: u64, hours: f64, event: Option<Event>) -> Vec<Run> {
        (0..runs).into_par_iter().map(|number| self.run(number, hours, event)).collect()
    }
}

impl Run {
    fn look(&mut self, time_s: f64, estimate: &Estimate, health: &Health, level: f64, kou_true: f64) {
        let within = |error: f64, se: f32| u32::from(error.abs() <= 1.96 * f64::from(se));
        if let Ok(seen) = estimate.seen {
            self.kou_looks += 1;
            self.kou_hits += within(f64::from(seen.kou.get()) - kou_true, seen.kou_se.get());
        }
        if time_s > 3600.0 {
            let error = f64::from(health.level.get()) - level;
            self.level_looks += 1;
            self.level_hits += within(error, health.level_se.get());
            self.level_error2 += error * error;
            self.level_error_in_se = Some(error / f64::from(health.level_se.get()));
        }
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
