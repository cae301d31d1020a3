//! Consistency check between the observed leakage and the learned leakage level.
//!
//! An in-range offset or slow drift of one sensor looks like leakage as long as no other sensor measures the same
//! quantity. The learned level contradicts it, because wear changes leakage slowly. The observed coefficient is
//! therefore compared with the learned level times the calibrated law:
//!
//! ```text
//! g  = |Kou_observed - level Kou_law|
//! s' = sqrt(s^2 + (g - s_observed)^2)    where g > s_observed + 2 s_level Kou_law, else s
//! ```
//!
//! Either the observation is right and the machine has changed, or the learned level is right and a sensor has
//! changed. The two explanations are `g` apart, which is at most 1.4 of the reported standard errors. Health
//! continues to learn and follows a faulty sensor, so the level learned before the first contradiction is the
//! reference. A discrepancy is open once contradictions have lasted for [`OPEN_COUNT`] estimates, or health reports a
//! change.
//!
//! * Only leakage explains it (health confirms wear): the observation is right, and the discrepancy is closed.
//! * Only a sensor, the displacement or the oil explains it: the estimate is invalid, [`Reason::SensorSuspected`],
//!   until the observation has agreed with the reference for [`RECOVER_COUNT`] estimates.
//! * Observation and learned level both agree with the reference for [`CLOSE_COUNT`] estimates: closed.
//!
//! Limits: before the level is learned, about a minute of steady drive, its standard error is 0.3 and almost nothing
//! contradicts it. A change slower than the drift detector of health can distinguish from wear is treated as wear.

use kou_estimator::health::{DtcStatus, Health, LevelChange};
use kou_estimator::units::LeakageCoefficient;
use kou_estimator::{Estimate, Expected, Observed, Reason};

/// Standard errors of the level within which an observation does not contradict it.
const LEVEL_SIGMAS: f32 = 2.0;

/// Contradicting estimates, one per 10 ms, that open a discrepancy: 5 s.
const OPEN_COUNT: u16 = 500;
/// Agreeing estimates that one contradicting estimate cancels; a manoeuvre contradicts for a moment.
const AGREEMENT_WEIGHT: u16 = 4;
/// Agreeing estimates after which a suspected sensor is used again: 5 s.
const RECOVER_COUNT: u16 = 500;
/// Agreeing estimates after which the discrepancy is closed: one minute.
const CLOSE_COUNT: u16 = 6000;

/// Learned leakage level relative to the law, with its standard error.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Learned {
    level: f32,
    level_se: f32,
}

/// Consistency check: reference level and counters of contradiction and agreement.
#[doc(alias = "parity check")]
#[doc(alias = "residual")]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConsistencyCheck {
    /// Reference level; frozen while there are contradictions.
    learned: Learned,
    is_open: bool,
    /// Contradicting minus agreeing estimates since the last time that the difference was zero.
    contradicted: u16,
    /// Agreeing estimates minus [`AGREEMENT_WEIGHT`] times the contradicting ones.
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

    /// Checks an estimate and widens or invalidates it; `last_change` is the last change reported by health.
    #[must_use]
    pub fn apply(&mut self, last_change: Option<LevelChange>, estimate: Estimate) -> Estimate {
        self.follow(&estimate.health, last_change);
        let (Ok(expected), Ok(seen)) = (estimate.expected, estimate.observed) else { return estimate };
        let law = expected.kou.get();
        let discrepancy = (seen.kou.get() - self.learned.level * law).abs();
        let excess = discrepancy - seen.kou_se.get();
        let contradicts = excess > LEVEL_SIGMAS * self.learned.level_se * law;
        self.count(contradicts);
        if estimate.health.sensor == DtcStatus::Confirmed && self.agreed < RECOVER_COUNT {
            let suspected = Reason::SensorSuspected;
            return Estimate { expected: Err(suspected), observed: Err(suspected), ..estimate };
        }
        if !contradicts {
            return estimate;
        }
        // The faulty sensor may be an input of the law as well.
        Estimate {
            expected: Ok(Expected { kou_se: widen(expected.kou_se, excess), ..expected }),
            observed: Ok(Observed { kou_se: widen(seen.kou_se, excess), ..seen }),
            ..estimate
        }
    }

    /// Opens or closes the discrepancy by the results of health, and updates the reference level while none is open.
    fn follow(&mut self, health: &Health, last_change: Option<LevelChange>) {
        if let (true, Some(change), false) = (health.changes != self.changes, last_change, self.is_open) {
            self.is_open = true;
            if self.contradicted == 0 {
                // After a restart only health knows the level before the change.
                let level_se = self.learned.level_se.min(health.level_se.get());
                self.learned = Learned { level: change.from.get(), level_se };
            }
        }
        self.changes = health.changes;
        let now = learned(health);
        let is_as_before = (now.level - self.learned.level).abs() <= LEVEL_SIGMAS * now.level_se;
        let is_wear = health.wear == DtcStatus::Confirmed && health.causes.only_leakage();
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
            observed: Ok(Observed {
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
        estimate.observed.unwrap().kou_se.get()
    }

    fn causes(of: &[Cause]) -> Causes {
        let bits = of.iter().fold(0_u16, |bits, cause| bits | 1 << *cause as u16);
        let mut buffer = [0; 4];
        postcard::from_bytes(postcard::to_slice(&bits, &mut buffer).unwrap()).unwrap()
    }

    fn change(from: f32, to: f32) -> Option<LevelChange> {
        Some(LevelChange { time: Micros(1), from: Ratio(from), to: Ratio(to), step: true })
    }

    #[test]
    fn estimate_that_agrees_with_the_learned_level_is_unchanged() {
        let mut check = ConsistencyCheck::new();
        let agrees = estimate(1.3 * LAW, 1.3, Health::new());
        assert_eq!(check.apply(None, agrees), agrees);
    }

    #[test]
    fn contradiction_widens_the_error_at_once_so_that_both_explanations_lie_within_it() {
        for seen in [0.3, 0.7, 1.3, 2.0, 5.0] {
            let reported = ConsistencyCheck::new().apply(None, estimate(seen * LAW, 1.0, Health::new()));
            // The square root of 2 where gap and sensor error combine worst, plus rounding.
            assert!((seen - 1.0).abs() * LAW < 1.415 * se(reported), "{seen}: {}", se(reported));
            assert!(se(reported) > SE && reported.expected.unwrap().kou_se.get() > SE, "{seen}");
        }
    }

    #[test]
    fn reference_level_is_frozen_until_a_change_is_explained_even_when_health_has_followed() {
        let mut check = ConsistencyCheck::new();
        assert!(check.apply(None, estimate(LAW, 1.0, Health::new())).observed.is_ok());
        let followed = Health { changes: 1, ..Health::new() };
        for _ in 0..3 {
            let reported = check.apply(change(1.0, 1.5), estimate(1.5 * LAW, 1.5, followed));
            assert!(0.5 * LAW < 3.0 * se(reported), "{}", se(reported));
        }
        // A second change does not make the level between the two known.
        let twice = Health { changes: 2, ..Health::new() };
        let reported = check.apply(change(1.5, 1.8), estimate(1.8 * LAW, 1.8, twice));
        assert!(0.8 * LAW < 3.0 * se(reported), "{}", se(reported));
        // Back at the reference, nothing is open.
        let back = estimate(LAW, 1.0, twice);
        assert_eq!(check.apply(change(1.5, 1.8), back), back);
    }

    #[test]
    fn confirmed_wear_is_accepted_and_a_suspected_sensor_invalidates() {
        let both = causes(&[Cause::Wear, Cause::Displacement]);
        let open = Health { changes: 1, causes: both, ..Health::new() };
        let mut check = ConsistencyCheck::new();
        assert!(check.apply(None, estimate(LAW, 1.0, Health::new())).observed.is_ok());
        assert!(se(check.apply(change(1.0, 1.5), estimate(1.5 * LAW, 1.5, open))) > 2.0 * SE);
        let worn = Health { causes: causes(&[Cause::Wear]), wear: DtcStatus::Confirmed, ..open };
        let believed = estimate(1.5 * LAW, 1.5, worn);
        assert_eq!(check.apply(change(1.0, 1.5), believed), believed);

        let suspected =
            Health { causes: causes(&[Cause::Displacement]), sensor: DtcStatus::Confirmed, ..open };
        let reported = ConsistencyCheck::new().apply(change(1.0, 1.5), estimate(1.5 * LAW, 1.0, suspected));
        assert_eq!(reported.observed, Err(Reason::SensorSuspected));
        assert_eq!(reported.expected, Err(Reason::SensorSuspected));
        // After five seconds of agreement the sensor is used again, whatever health still waits for.
        let mut check = ConsistencyCheck::new();
        for _ in 0..RECOVER_COUNT {
            assert!(check.apply(change(1.0, 1.5), estimate(1.5 * LAW, 1.0, suspected)).observed.is_err());
        }
        for i in 1..=RECOVER_COUNT {
            let reported = check.apply(change(1.0, 1.5), estimate(LAW, 1.0, suspected));
            assert_eq!(reported.observed.is_ok(), i == RECOVER_COUNT, "{i}");
        }
    }

    #[test]
    fn level_that_health_learns_from_a_faulty_sensor_does_not_become_the_reference() {
        let mut check = ConsistencyCheck::new();
        assert!(check.apply(None, estimate(LAW, 1.0, Health::new())).observed.is_ok());
        let mut level = 1.0;
        for i in 0..3000 {
            // Health follows by two thirds before it reports, and one operating point in ten shows almost nothing.
            level += 0.001 * (0.5 - level);
            let seen = if i % 10 == 0 { 0.97 } else { 0.5 };
            let reported = check.apply(None, estimate(seen * LAW, level, Health::new()));
            assert!((1.0 - seen) * LAW < 3.0 * se(reported), "{i}: {}", se(reported));
        }
        // The sensor has recovered, health has not yet: the observation is reported unchanged.
        let agrees = estimate(LAW, level, Health::new());
        for _ in 0..2 * CLOSE_COUNT {
            assert_eq!(check.apply(None, agrees), agrees);
        }
        assert!(check.is_open);
        assert!(check.apply(None, estimate(LAW, 0.99, Health::new())).observed.is_ok());
        assert!(!check.is_open);
    }

    #[test]
    fn a_reason_of_the_estimator_is_preserved() {
        let mut invalid = estimate(LAW, 1.0, Health { sensor: DtcStatus::Confirmed, ..Health::new() });
        invalid.observed = Err(Reason::RatioAboveLeakFree);
        assert_eq!(ConsistencyCheck::new().apply(None, invalid).observed, Err(Reason::RatioAboveLeakFree));
    }
}
