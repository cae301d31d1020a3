//! Edge counter and speed measurement of one pickup.

use kou_estimator::units::{Micros, RevPerMin};
use kou_estimator::{Fault, Reading};

use super::super::debounce::DebounceState;
use super::config::PickupParams;
use super::edges::Edges;

/// Consecutive irregular edges after which the pitch is learned anew. A reference gap causes one; a gap next to a
/// lost edge two.
pub const RESYNC: u8 = 3;
/// Regular edges that compensate one irregular edge.
const ODD_WEIGHT: u8 = 3;

/// Consecutive similar pitches after which a newly learned pitch is valid.
pub const SETTLED: u8 = 3;

/// Number of stored window starts; one is added at most every [`ANCHOR_SHARE`] of the window.
const ANCHORS: usize = 9;
const ANCHOR_SHARE: u64 = 8;
/// Limits of an interval relative to the present pitch.
const SHORTEST: f32 = 0.6;
const LONGEST: f32 = 1.6;
/// Largest deviation of a gap from a whole number of pitches.
const GAP_BAND: f32 = 0.35;
/// Largest relative difference between similar pitches.
const ALIKE_BAND: f32 = 0.25;
/// Fewest pitches per window, unless they take longer than the window itself.
const LEAST_PITCHES: u64 = 6;

/// Counted edge: pitches so far, and its time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Anchor {
    pitches: u64,
    at: u64,
}

/// Counts of edges by classification; each saturates.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct PickupCounts {
    /// Edges counted as one pitch.
    pub pitches: u32,
    /// Edges ignored as glitches.
    pub glitches: u32,
    /// Edges counted as several pitches.
    pub gaps: u32,
    /// Times that the pitch was learned anew.
    pub resyncs: u32,
}

/// State of one pickup.
#[doc(alias = "tachometer")]
#[doc(alias = "speed sensor")]
#[derive(Debug, Clone)]
pub struct PickupState {
    /// Timer count at the last poll, extended by its wraps.
    now: u64,
    count: Option<u32>,
    /// Last counted edge; `None` before the first and after standstill.
    last: Option<Anchor>,
    anchors: heapless::Deque<Anchor, ANCHORS>,
    /// Time of the last edge of any kind.
    last_edge: u64,
    /// Time of the last counted edge or restart.
    quiet_since: u64,
    /// Present pitch in counts; 0 while unknown.
    pitch: f32,
    /// Last three pitches, newest first: their median is the present pitch, which no single bad edge moves.
    recent: [f32; 3],
    alike: u8,
    odd_level: u8,
    debounce: DebounceState,
    counts: PickupCounts,
    time: Micros,
    speed: Option<(Micros, f32)>,
}

impl PickupState {
    /// State before the first edge.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            now: 0,
            count: None,
            last: None,
            anchors: heapless::Deque::new(),
            last_edge: 0,
            quiet_since: 0,
            pitch: 0.0,
            recent: [0.0; 3],
            alike: 0,
            odd_level: 0,
            debounce: DebounceState::new(),
            counts: PickupCounts { pitches: 0, glitches: 0, gaps: 0, resyncs: 0 },
            time: Micros(0),
            speed: None,
        }
    }

    /// Counts of edges by classification.
    #[must_use]
    pub const fn counts(&self) -> PickupCounts {
        self.counts
    }

    /// Whether the present window is less than half full since the pitch was learned anew.
    #[cfg(test)]
    pub(crate) fn fresh(&self) -> bool {
        self.anchors.len() < 5
    }

    /// Processes the edges since the last poll. `count` is the timer's count at `now`; polls must be more frequent
    /// than its wraps. An edge stamped later than `count` or before the last poll is ignored as a glitch.
    pub fn poll(&mut self, params: &PickupParams, now: Micros, count: u32, edges: &Edges) {
        self.time = now;
        let before = *self.count.get_or_insert(count);
        self.count = Some(count);
        let elapsed = count.wrapping_sub(before);
        let from = self.now;
        self.now = from.saturating_add(u64::from(elapsed));
        if edges.lost {
            self.restart(None);
            self.quiet_since = self.now;
        }
        for &stamp in edges.stamps() {
            let since = stamp.wrapping_sub(before);
            if since > elapsed {
                self.counts.glitches = self.counts.glitches.saturating_add(1);
                continue;
            }
            self.edge(params, from.saturating_add(u64::from(since)));
        }
        if self.now.saturating_sub(self.quiet_since) > params.zero {
            // Standstill. The next edge starts anew; a fault of the wheel cannot be observed and is cleared.
            self.restart(None);
            self.debounce = DebounceState::new();
            self.speed = Some((now, 0.0));
        } else if let Some(speed) = self.measured(params) {
            self.speed = Some(speed);
        }
    }

    /// Present speed without sign: a pickup does not sense the direction.
    #[must_use]
    pub fn reading(&self, params: &PickupParams) -> Reading<RevPerMin> {
        match (self.debounce.fault(), self.speed) {
            (Some(fault), _) => Reading::failed(self.time, fault),
            (None, None) => Reading::failed(self.time, Fault::Missing),
            (None, Some((_, rpm))) if rpm > params.max_rpm => Reading::failed(self.time, Fault::OutOfRange),
            (None, Some((time, rpm))) => Reading::new(time, RevPerMin(rpm)),
        }
    }

    /// Speed over the window, or the upper bound implied by the time since the last edge, with its time.
    fn measured(&self, params: &PickupParams) -> Option<(Micros, f32)> {
        let last = self.last?;
        if self.alike < SETTLED {
            return None;
        }
        let first = self.window_start(params, last)?;
        let pitches = last.pitches.saturating_sub(first.pitches);
        let span = last.at.saturating_sub(first.at);
        if pitches < LEAST_PITCHES && span < params.window {
            return None;
        }
        let rpm = params.rpm_counts * pitches as f32 / span as f32;
        // The next edge could come now, after at most the longest gap. An irregular edge ends the silence as well.
        let silence = self.now.saturating_sub(self.last_edge.max(last.at));
        let bound = params.rpm_counts * f32::from(params.longest_gap) / silence.max(1) as f32;
        if bound < rpm {
            return Some((self.time, bound));
        }
        let since_last = self.now.saturating_sub(last.at);
        let age_us = since_last.saturating_mul(1000) / u64::from(params.counts_per_ms.max(1));
        Some((Micros(self.time.0.saturating_sub(age_us)), rpm))
    }

    /// Newest anchor at least a window before the last edge, else the oldest.
    fn window_start(&self, params: &PickupParams, last: Anchor) -> Option<Anchor> {
        let mut start = None;
        for &anchor in &self.anchors {
            if anchor.at >= last.at {
                break;
            }
            // From the oldest on: each later one that is still far enough away is better.
            if start.is_none() || last.at.saturating_sub(anchor.at) >= params.window {
                start = Some(anchor);
            }
        }
        start
    }

    fn edge(&mut self, params: &PickupParams, at: u64) {
        self.last_edge = at;
        let Some(last) = self.last else {
            self.restart(Some(at));
            return;
        };
        let interval = at.saturating_sub(last.at);
        if interval < params.soonest {
            self.odd_edge(params, at, Odd::Glitch);
            return;
        }
        if self.alike < SETTLED {
            self.learn(params, at, interval as f32);
            return;
        }
        let pitches = interval as f32 / self.pitch;
        if pitches < SHORTEST {
            self.odd_edge(params, at, Odd::Glitch);
        } else if pitches <= LONGEST {
            self.pitch = self.median_with(interval as f32);
            self.odd_level = self.odd_level.saturating_sub(1);
            self.counts.pitches = self.counts.pitches.saturating_add(1);
            self.debounce.update(&params.debounce, Ok(()));
            self.count_pitches(params, at, 1);
        } else {
            let whole = libm::roundf(pitches);
            let fits = whole <= f32::from(params.longest_gap) && (pitches - whole).abs() <= GAP_BAND;
            self.odd_edge(params, at, if fits { Odd::Gap(whole as u64) } else { Odd::TooLate });
        }
    }

    /// While the pitch is unknown, every plausible edge counts as one pitch; a glitch or a gap among them only
    /// prolongs learning.
    fn learn(&mut self, params: &PickupParams, at: u64, interval: f32) {
        let known = self.pitch > 0.0;
        let alike = known && (interval / self.pitch - 1.0).abs() <= ALIKE_BAND;
        self.alike = if alike { self.alike.saturating_add(1) } else { 0 };
        self.median_with(interval);
        self.pitch = interval;
        if known {
            self.debounce.update(&params.debounce, if alike { Ok(()) } else { Err(Fault::Rate) });
        }
        // Previous counts may be wrong: the window starts here.
        self.anchors.clear();
        self.count_pitches(params, at, 1);
    }

    /// Stores a pitch and returns the median of the last three.
    fn median_with(&mut self, interval: f32) -> f32 {
        let [a, b, _] = self.recent;
        self.recent = [interval, a, b];
        interval.min(a).max(interval.max(a).min(b))
    }

    fn odd_edge(&mut self, params: &PickupParams, at: u64, odd: Odd) {
        let fresh = self.odd_level == 0;
        self.odd_level = self.odd_level.saturating_add(ODD_WEIGHT);
        let counter = match odd {
            Odd::Glitch => &mut self.counts.glitches,
            Odd::Gap(_) | Odd::TooLate => &mut self.counts.gaps,
        };
        *counter = counter.saturating_add(1);
        // A gap occurs once per revolution at a reference mark, or at a lost edge: a fault only when it repeats.
        let ordinary = matches!(odd, Odd::Gap(_)) && fresh;
        self.debounce.update(&params.debounce, if ordinary { Ok(()) } else { Err(Fault::Rate) });
        if !fresh {
            // Two within a few pitches: previous counts may be wrong, so the window restarts.
            self.anchors.clear();
        }
        if self.odd_level >= RESYNC * ODD_WEIGHT {
            self.counts.resyncs = self.counts.resyncs.saturating_add(1);
            self.restart(Some(at));
            return;
        }
        if let Odd::Gap(pitches) = odd {
            self.count_pitches(params, at, pitches);
        }
    }

    fn count_pitches(&mut self, params: &PickupParams, at: u64, pitches: u64) {
        let before = self.last.map_or(0, |last| last.pitches);
        let anchor = Anchor { pitches: before.saturating_add(pitches), at };
        self.last = Some(anchor);
        self.quiet_since = at;
        let due = match self.anchors.back() {
            Some(newest) => at.saturating_sub(newest.at) >= params.window / ANCHOR_SHARE,
            None => true,
        };
        if due {
            if self.anchors.is_full() {
                self.anchors.pop_front();
            }
            // There is room: one was just removed.
            self.anchors.push_back(anchor).ok();
        }
    }

    /// Restarts with an edge at `at`, or without one.
    fn restart(&mut self, at: Option<u64>) {
        self.pitch = 0.0;
        self.alike = 0;
        self.odd_level = 0;
        self.anchors.clear();
        self.last = at.map(|at| Anchor { pitches: 0, at });
        if let Some(anchor) = self.last {
            self.quiet_since = anchor.at;
            self.anchors.push_back(anchor).ok();
        }
    }
}

impl Default for PickupState {
    fn default() -> Self {
        Self::new()
    }
}

/// Classification of an irregular edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Odd {
    /// Too early: a glitch.
    Glitch,
    /// Gap of this many pitches.
    Gap(u64),
    /// Later than any gap, or not at a whole number of pitches. Ignored, like a glitch.
    TooLate,
}
