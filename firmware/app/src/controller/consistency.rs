//! What may be told of an estimate while it is open whether a sensor or the machine has changed.
//!
//! An in-range offset or a slow drift of one sensor looks like leakage as long as nothing else measures the same. What the drive has
//! learned of its leakage contradicts it: leakage changes by wear, that is slowly. So the coefficient seen is compared with the level
//! learned times the law:
//!
//! ```text
//! g   = |Kou_seen - level Kou_law|
//! s'  = sqrt(s^2 + (g - s_seen)^2)    where g > s_seen + 2 s_level Kou_law, else s
//! ```
//!
//! Either what is seen is right and the machine has changed, or what was learned is right and a sensor has: they lie `g` apart,
//! which is at most 1.4 of the standard errors reported. Health goes on learning and follows the wrong sensor, too, so what was learned before stands
//! from the first contradiction on. It is an open question once contradictions have lasted for [`OPEN_COUNT`], or health reports a change.
//!
//! * Only leakage explains it (health confirms wear): what is seen is right, and the question is closed.
//! * Only a sensor, the displacement or the oil does: the estimate is invalid, [`Reason::SensorSuspected`], until for
//!   [`RECOVER_COUNT`] what is seen has been as before.
//! * What is seen and what health has learned are both as before for [`CLOSE_COUNT`]: closed.
//!
//! Limits: before the level is learned, some minute of steady drive, its standard error is 0.3 and next to nothing contradicts it.
//! What changes more slowly than health's drift watch can tell from wear is wear to it.

use kou_estimator::health::{Change, Health, Stage};
use kou_estimator::units::LeakageCoefficient;
use kou_estimator::{Estimate, Expected, Reason, Seen};

/// Standard errors of the level that are no contradiction yet.
const LEVEL_SIGMAS: f32 = 2.0;

/// Estimates, one each 10 ms, that contradict before there is a question: 5 s.
const OPEN_COUNT: u16 = 500;
/// How many estimates that do not contradict one that does outweighs: a manoeuvre contradicts for a moment, too.
const AGREEMENT_WEIGHT: u16 = 4;
/// Estimates that do not, after which a suspected sensor is used again: 5 s.
const RECOVER_COUNT: u16 = 500;
/// Estimates that do not, after which the question is closed: a minute.
const CLOSE_COUNT: u16 = 6000;

/// A level of leakage over the law's, as learned.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Learned {
    level: f32,
    level_se: f32,
}

/// What was learned before it was contradicted, and for how long it has been.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConsistencyCheck {
    /// Learned; stands still as long as there are contradictions.
    learned: Learned,
    is_open: bool,
    /// Contradictions, less estimates without, since the last time that there were none.
    contradicted: u16,
    /// Estimates without, less [`AGREEMENT_WEIGHT`] times those with.
    agreed: u16,
    changes: u16,
}

impl ConsistencyCheck {
    /// Nothing learned.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            learned: learned(&Health::new()),
            is_open: false,
            contradicted: 0,
            agreed: RECOVER_COUNT,
            changes: 0,
        }
    }

    /// The estimate as it may be told; `last_change` is the last one that health has reported.
    #[must_use]
    pub fn apply(&mut self, last_change: Option<Change>, estimate: Estimate) -> Estimate {
        self.follow(&estimate.health, last_change);
        let (Ok(expected), Ok(seen)) = (estimate.expected, estimate.seen) else { return estimate };
        let law = expected.kou.get();
        let discrepancy = (seen.kou.get() - self.learned.level * law).abs();
        let excess = discrepancy - seen.kou_se.get();
        let contradicts = excess > LEVEL_SIGMAS * self.learned.level_se * law;
        self.count(contradicts);
        if estimate.health.sensor == Stage::Confirmed && self.agreed < RECOVER_COUNT {
            let suspected = Reason::SensorSuspected;
            return Estimate { expected: Err(suspected), seen: Err(suspected), ..estimate };
        }
        if !contradicts {
            return estimate;
        }
        // The wrong sensor may be one that the law takes, too.
        Estimate {
            expected: Ok(Expected { kou_se: widen(expected.kou_se, excess), ..expected }),
            seen: Ok(Seen { kou_se: widen(seen.kou_se, excess), ..seen }),
            ..estimate
        }
    }

    /// Opens and closes the question by what health says, and takes over what it has learned while there is none.
    fn follow(&mut self, health: &Health, last_change: Option<Change>) {
        if let (true, Some(change), false) = (health.changes != self.changes, last_change, self.is_open) {
            self.is_open = true;
            if self.contradicted == 0 {
                // After a restart nothing was learned before it but by health.
                let level_se = self.learned.level_se.min(health.level_se.get());
                self.learned = Learned { level: change.from.get(), level_se };
            }
        }
        self.changes = health.changes;
        let now = learned(health);
        let is_as_before = (now.level - self.learned.level).abs() <= LEVEL_SIGMAS * now.level_se;
        let is_wear = health.wear == Stage::Confirmed && health.causes.only_leakage();
        if is_wear || (is_as_before && self.agreed >= CLOSE_COUNT) {
            self.is_open = false;
            self.contradicted = 0;
        }
        if !self.is_open && self.contradicted == 0 {
            self.learned = now;
        }
    }

    fn count(&mut self, contradicts: bool) {
        if contradicts {
            self.contradicted = self.contradicted.saturating_add(1).min(OPEN_COUNT);
            self.agreed = self.agreed.saturating_sub(AGREEMENT_WEIGHT);
            self.is_open |= self.contradicted == OPEN_COUNT;
        } else {
            self.contradicted = self.contradicted.saturating_sub(1);
            self.agreed = self.agreed.saturating_add(1).min(CLOSE_COUNT);
        }
    }
}

const fn learned(health: &Health) -> Learned {
    Learned { level: health.level.get(), level_se: health.level_se.get() }
}

fn widen(standard_error: LeakageCoefficient, excess: f32) -> LeakageCoefficient {
    let own = standard_error.get();
    LeakageCoefficient(libm::sqrtf(own * own + excess * excess))
}

#[cfg(test)]
mod tests {
    use kou_estimator::health::{Cause, Causes};
    use kou_estimator::units::{LitrePerMin, Micros, Ratio};

    use super::*;

    const LAW: f32 = 0.07;
    const SE: f32 = 0.003;

    fn estimate(seen: f32, level: f32, health: Health) -> Estimate {
        let (ratio, efficiency, leakage) = (Ratio(0.93), Ratio(0.93), LitrePerMin(15.0));
        Estimate {
            time: Micros(0),
            expected: Ok(Expected {
                kou: LeakageCoefficient(LAW),
                kou_se: LeakageCoefficient(SE),
                ratio,
                volumetric_efficiency: efficiency,
                leakage,
            }),
            seen: Ok(Seen {
                ratio,
                kou: LeakageCoefficient(seen),
                kou_se: LeakageCoefficient(SE),
                volumetric_efficiency: efficiency,
                leakage,
            }),
            health: Health { level: Ratio(level), level_se: Ratio(0.02), ..health },
        }
    }

    fn se(estimate: Estimate) -> f32 {
        estimate.seen.unwrap().kou_se.get()
    }

    fn causes(of: &[Cause]) -> Causes {
        let bits = of.iter().fold(0_u16, |bits, cause| bits | 1 << *cause as u16);
        let mut buffer = [0; 4];
        postcard::from_bytes(postcard::to_slice(&bits, &mut buffer).unwrap()).unwrap()
    }

    fn change(from: f32, to: f32) -> Option<Change> {
        Some(Change { time: Micros(1), from: Ratio(from), to: Ratio(to), step: true })
    }

    #[test]
    fn what_agrees_with_the_level_learned_is_told_as_it_is() {
        let mut check = ConsistencyCheck::new();
        let agrees = estimate(1.3 * LAW, 1.3, Health::new());
        assert_eq!(check.apply(None, agrees), agrees);
    }

    #[test]
    fn a_contradiction_widens_the_error_at_once_so_that_both_explanations_lie_within_it() {
        for seen in [0.3, 0.7, 1.3, 2.0, 5.0] {
            let reported = ConsistencyCheck::new().apply(None, estimate(seen * LAW, 1.0, Health::new()));
            // The square root of 2 where gap and the sensors' error are worst to each other, and rounding.
            assert!((seen - 1.0).abs() * LAW < 1.415 * se(reported), "{seen}: {}", se(reported));
            assert!(se(reported) > SE && reported.expected.unwrap().kou_se.get() > SE, "{seen}");
        }
    }

    #[test]
    fn until_a_change_is_explained_the_level_before_it_stands_even_when_health_has_followed() {
        let mut check = ConsistencyCheck::new();
        assert!(check.apply(None, estimate(LAW, 1.0, Health::new())).seen.is_ok());
        let followed = Health { changes: 1, ..Health::new() };
        for _ in 0..3 {
            let reported = check.apply(change(1.0, 1.5), estimate(1.5 * LAW, 1.5, followed));
            assert!(0.5 * LAW < 3.0 * se(reported), "{}", se(reported));
        }
        // A second one does not make the level between them known.
        let twice = Health { changes: 2, ..Health::new() };
        let reported = check.apply(change(1.5, 1.8), estimate(1.8 * LAW, 1.8, twice));
        assert!(0.8 * LAW < 3.0 * se(reported), "{}", se(reported));
        // Back where it was nothing is open.
        let back = estimate(LAW, 1.0, twice);
        assert_eq!(check.apply(change(1.5, 1.8), back), back);
    }

    #[test]
    fn confirmed_wear_is_believed_and_a_suspected_sensor_is_not() {
        let both = causes(&[Cause::Wear, Cause::Displacement]);
        let open = Health { changes: 1, causes: both, ..Health::new() };
        let mut check = ConsistencyCheck::new();
        assert!(check.apply(None, estimate(LAW, 1.0, Health::new())).seen.is_ok());
        assert!(se(check.apply(change(1.0, 1.5), estimate(1.5 * LAW, 1.5, open))) > 2.0 * SE);
        let worn = Health { causes: causes(&[Cause::Wear]), wear: Stage::Confirmed, ..open };
        let believed = estimate(1.5 * LAW, 1.5, worn);
        assert_eq!(check.apply(change(1.0, 1.5), believed), believed);

        let suspected = Health { causes: causes(&[Cause::Displacement]), sensor: Stage::Confirmed, ..open };
        let reported = ConsistencyCheck::new().apply(change(1.0, 1.5), estimate(1.5 * LAW, 1.0, suspected));
        assert_eq!(reported.seen, Err(Reason::SensorSuspected));
        assert_eq!(reported.expected, Err(Reason::SensorSuspected));
        // As before for five seconds: used again, whatever health still waits for.
        let mut check = ConsistencyCheck::new();
        for _ in 0..RECOVER_COUNT {
            assert!(check.apply(change(1.0, 1.5), estimate(1.5 * LAW, 1.0, suspected)).seen.is_err());
        }
        for i in 1..=RECOVER_COUNT {
            let reported = check.apply(change(1.0, 1.5), estimate(LAW, 1.0, suspected));
            assert_eq!(reported.seen.is_ok(), i == RECOVER_COUNT, "{i}");
        }
    }

    #[test]
    fn what_health_learns_of_a_wrong_sensor_does_not_become_what_was_learned() {
        let mut check = ConsistencyCheck::new();
        assert!(check.apply(None, estimate(LAW, 1.0, Health::new())).seen.is_ok());
        let mut level = 1.0;
        for i in 0..3000 {
            // Health follows to two thirds before it reports, and one operating point in ten shows next to nothing.
            level += 0.001 * (0.5 - level);
            let seen = if i % 10 == 0 { 0.97 } else { 0.5 };
            let reported = check.apply(None, estimate(seen * LAW, level, Health::new()));
            assert!((1.0 - seen) * LAW < 3.0 * se(reported), "{i}: {}", se(reported));
        }
        // The sensor is right again, health not yet: what is seen is told as it is.
        let agrees = estimate(LAW, level, Health::new());
        for _ in 0..2 * CLOSE_COUNT {
            assert_eq!(check.apply(None, agrees), agrees);
        }
        assert!(check.is_open);
        assert!(check.apply(None, estimate(LAW, 0.99, Health::new())).seen.is_ok());
        assert!(!check.is_open);
    }

    #[test]
    fn a_reason_of_the_estimator_stays() {
        let mut invalid = estimate(LAW, 1.0, Health { sensor: Stage::Confirmed, ..Health::new() });
        invalid.seen = Err(Reason::RatioAboveLeakFree);
        assert_eq!(ConsistencyCheck::new().apply(None, invalid).seen, Err(Reason::RatioAboveLeakFree));
    }
}
