//! Health monitoring over a log.

use std::collections::BTreeMap;

use kou_estimator::health::{Cause, DtcStatus, GateClosed, Health, Severity};
use kou_estimator::units::Micros;
use kou_estimator::{Estimate, Params, State};
use serde::Serialize;

use super::labels::reason_label;

/// Name of a reason for a closed gate, with the sample's own reason where it has one.
#[must_use]
pub fn gate_label(closed: GateClosed) -> String {
    match closed {
        GateClosed::Sample(reason) => reason_label(reason),
        _ => closed.name().to_string(),
    }
}

/// Name of a fault's debounce status.
#[must_use]
pub const fn stage_name(stage: DtcStatus) -> &'static str {
    match stage {
        DtcStatus::Absent => "absent",
        DtcStatus::Pending => "pending",
        DtcStatus::Confirmed => "confirmed",
        DtcStatus::Healed => "healed",
    }
}

/// Names of the causes that remain.
#[must_use]
pub fn cause_names(health: &Health) -> Vec<&'static str> {
    health.causes.iter().map(Cause::name).collect()
}

/// Sums over the estimates of a log.
#[derive(Debug, Clone, Default)]
pub struct HealthSummary {
    last: Option<Health>,
    open: u64,
    closed: BTreeMap<String, u64>,
    changes: Vec<ChangeFigures>,
}

/// A change as first reported.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ChangeFigures {
    /// Time of the sample whose estimate reported it, s.
    pub time_s: f64,
    /// Level reported with it; it follows the change within some blocks.
    pub level: f64,
}

/// Health at the end of a replay, as its JSON states it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HealthFigures {
    /// Level: leakage over the law's.
    pub level: f64,
    /// Standard error of the level.
    pub level_se: f64,
    /// Factor on the ratio that is not leakage, less 1.
    pub ratio_offset: f64,
    /// Changes that were reported.
    pub changes: Vec<ChangeFigures>,
    /// Causes that remain for the last change.
    pub causes: Vec<&'static str>,
    /// Status of the fault that the machine leaks more than before.
    pub wear: &'static str,
    /// Status of the fault that a sensor, the displacement or the oil explains a change.
    pub sensor: &'static str,
    /// Samples for which the gate was open.
    pub gate_open: u64,
    /// Samples for which it was closed, by reason.
    pub gate_closed: BTreeMap<String, u64>,
    /// Severity at the rated point: flow in L/min, loss of ratio, ratio to new, Kou in (L/min)/MPa.
    pub at_rated_point: Severity,
    /// Change of the level per hour of judged driving, with its standard error, once known.
    pub level_per_h: Option<[f64; 2]>,
    /// Remaining hours to the limit, expected and lower bound, once a trend is known.
    pub remaining_h: Option<[f64; 2]>,
}

impl HealthSummary {
    /// Adds one estimate.
    pub fn add(&mut self, estimate: &Estimate) {
        let health = estimate.health;
        if health.changes > self.last.map_or(0, |last| last.changes) {
            let level = health.level.get().into();
            self.changes.push(ChangeFigures { time_s: seconds(estimate.time), level });
        }
        match health.gate {
            Ok(()) => self.open += 1,
            Err(closed) => *self.closed.entry(gate_label(closed)).or_default() += 1,
        }
        self.last = Some(health);
    }

    /// The figures so far; `state` is that after the last estimate.
    #[must_use]
    pub fn figures(&self, params: &Params, state: &State) -> HealthFigures {
        let health = self.last.unwrap_or_default();
        let pair = |a: f32, b: f32| [f64::from(a), f64::from(b)];
        HealthFigures {
            level: health.level.get().into(),
            level_se: health.level_se.get().into(),
            ratio_offset: health.ratio_offset.get().into(),
            changes: self.changes.clone(),
            causes: cause_names(&health),
            wear: stage_name(health.wear),
            sensor: stage_name(health.sensor),
            gate_open: self.open,
            gate_closed: self.closed.clone(),
            at_rated_point: params.health().severity(health.level),
            level_per_h: state.health().slope().map(|s| pair(s.per_h, s.per_h_se)),
            remaining_h: state
                .health()
                .remaining_life(params.health())
                .map(|r| pair(r.hours, r.at_least_hours)),
        }
    }
}

impl HealthFigures {
    /// The figures as text.
    #[must_use]
    pub fn text(&self) -> String {
        let rated = &self.at_rated_point;
        let mut text = format!(
            "level {:.3} +- {:.3} times the law, {:.2} L/min at the rated point; gate open for {} samples",
            self.level,
            self.level_se,
            rated.leakage.get(),
            self.gate_open
        );
        for change in &self.changes {
            text += &format!("\n  changed at {:.1} s, level then {:.3}", change.time_s, change.level);
        }
        if !self.causes.is_empty() {
            text += &format!("\n  possible causes of the last change: {}", self.causes.join(", "));
        }
        text += &format!("\nwear {}, sensor {}", self.wear, self.sensor);
        if let Some([hours, at_least]) = self.remaining_h {
            text += &format!("; {hours:.0} h to the limit, at least {at_least:.0} h");
        }
        text
    }
}

#[allow(clippy::cast_precision_loss, reason = "microseconds of a log fit 53 bits")]
fn seconds(time: Micros) -> f64 {
    time.0 as f64 / 1e6
}
