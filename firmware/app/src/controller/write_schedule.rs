//! Schedule of flash writes, with the rates that bound wear.
//!
//! Operating counters and learned health are written once per period; the fault memory when it has changed, but
//! limited by a token bucket, since any node on the bus can make faults come and go. One record is written per cycle
//! of the task, which bounds the cycle's execution time.

use kou_estimator::units::Micros;

/// Rates of writing, unchecked.
#[doc(alias = "token bucket")]
#[doc(alias = "wear levelling")]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WriteScheduleConfig {
    /// Time between two writes of learned health, s: the most that a power cut loses of it.
    pub health_s: u32,
    /// Time between two writes of the operating counters, s: the most that a power cut loses of them.
    pub counters_s: u32,
    /// Writes of the fault memory in immediate succession: capacity of the token bucket.
    pub fault_burst: u8,
    /// Time after which one more write of the fault memory is allowed, s.
    pub fault_refill_s: u32,
}

impl WriteScheduleConfig {
    /// Rates for a vehicle; `docs/storage.md` states the resulting flash lifetime.
    pub const VEHICLE: Self = Self { health_s: 600, counters_s: 600, fault_burst: 6, fault_refill_s: 600 };
}

/// Reason for rejecting rates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum WriteScheduleError {
    /// [`WriteScheduleConfig::health_s`] is not within 1 to 86 400 s.
    Health,
    /// [`WriteScheduleConfig::counters_s`] is not within 1 to 86 400 s.
    OperatingCounters,
    /// [`WriteScheduleConfig::fault_burst`] is 0, or [`WriteScheduleConfig::fault_refill_s`] not within 1 to 86 400 s.
    Faults,
}

/// Checked rates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WriteScheduleParams {
    health_s: u32,
    counters_s: u32,
    fault_burst: u8,
    fault_refill_s: u32,
}

impl WriteScheduleParams {
    /// Checks the rates.
    ///
    /// # Errors
    /// The first rate out of range.
    pub const fn new(config: &WriteScheduleConfig) -> Result<Self, WriteScheduleError> {
        const fn is_span(seconds: u32) -> bool {
            seconds >= 1 && seconds <= 86_400
        }
        if !is_span(config.health_s) {
            return Err(WriteScheduleError::Health);
        }
        if !is_span(config.counters_s) {
            return Err(WriteScheduleError::OperatingCounters);
        }
        if config.fault_burst == 0 || !is_span(config.fault_refill_s) {
            return Err(WriteScheduleError::Faults);
        }
        let WriteScheduleConfig { health_s, counters_s, fault_burst, fault_refill_s } = *config;
        Ok(Self { health_s, counters_s, fault_burst, fault_refill_s })
    }
}

/// Time after start before which neither faults nor health are written, s: a controller that restarts repeatedly
/// wears its flash only by the few bytes of the operating counters.
const HOLDOFF_S: u32 = 2;

/// Record that is due in a cycle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum DueWrite {
    Nothing,
    Faults,
    Health,
    OperatingCounters,
}

/// Times of the last writes, in seconds since start.
#[derive(Debug, Clone)]
pub(super) struct WriteSchedule {
    params: WriteScheduleParams,
    health_at_s: u32,
    counters_at_s: u32,
    fault_writes_left: u8,
    refilled_at_s: u32,
}

impl WriteSchedule {
    /// At start, when the operating counters have just been written.
    pub const fn new(params: WriteScheduleParams) -> Self {
        Self {
            params,
            health_at_s: 0,
            counters_at_s: 0,
            fault_writes_left: params.fault_burst,
            refilled_at_s: 0,
        }
    }

    /// Record that is due at `now`; `faults_changed` and `health_changed` refer to the last write. The returned
    /// record counts as written even when the flash fails: endless retries would cause the most wear.
    pub fn due(&mut self, now: Micros, faults_changed: bool, health_changed: bool) -> DueWrite {
        let now_s = u32::try_from(now.0 / 1_000_000).unwrap_or(u32::MAX);
        let since = |at_s: u32| now_s.saturating_sub(at_s);
        if since(self.refilled_at_s) >= self.params.fault_refill_s {
            self.refilled_at_s = now_s;
            self.fault_writes_left = self.fault_writes_left.saturating_add(1).min(self.params.fault_burst);
        }
        if now_s >= HOLDOFF_S && faults_changed && self.fault_writes_left > 0 {
            if self.fault_writes_left == self.params.fault_burst {
                self.refilled_at_s = now_s;
            }
            self.fault_writes_left = self.fault_writes_left.saturating_sub(1);
            return DueWrite::Faults;
        }
        if now_s >= HOLDOFF_S && health_changed && since(self.health_at_s) >= self.params.health_s {
            self.health_at_s = now_s;
            return DueWrite::Health;
        }
        if since(self.counters_at_s) >= self.params.counters_s {
            self.counters_at_s = now_s;
            return DueWrite::OperatingCounters;
        }
        DueWrite::Nothing
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn schedule() -> WriteSchedule {
        WriteSchedule::new(WriteScheduleParams::new(&WriteScheduleConfig::VEHICLE).unwrap())
    }

    fn seconds(s: u32) -> Micros {
        Micros(1_000_000 * u64::from(s))
    }

    #[test]
    fn rates_out_of_range_are_rejected_by_name() {
        let good = WriteScheduleConfig::VEHICLE;
        for (config, why) in [
            (WriteScheduleConfig { health_s: 0, ..good }, WriteScheduleError::Health),
            (WriteScheduleConfig { counters_s: 86_401, ..good }, WriteScheduleError::OperatingCounters),
            (WriteScheduleConfig { fault_burst: 0, ..good }, WriteScheduleError::Faults),
            (WriteScheduleConfig { fault_refill_s: 0, ..good }, WriteScheduleError::Faults),
        ] {
            assert_eq!(WriteScheduleParams::new(&config), Err(why));
        }
    }

    #[test]
    fn faults_that_come_and_go_for_a_day_cause_a_bounded_number_of_writes() {
        let mut schedule = schedule();
        let writes =
            (1..86_400).filter(|s| schedule.due(seconds(*s), true, false) == DueWrite::Faults).count();
        assert_eq!(writes, 6 + 86_400 / 600 - 1);
    }

    #[test]
    fn health_and_counters_are_written_once_per_period_and_unchanged_health_is_not() {
        let mut schedule = schedule();
        let due: std::vec::Vec<DueWrite> =
            (1..6_001).map(|s| schedule.due(seconds(s), false, s > 3_000)).collect();
        let count = |what| due.iter().filter(|one| **one == what).count();
        assert_eq!(
            (count(DueWrite::OperatingCounters), count(DueWrite::Health), count(DueWrite::Faults)),
            (10, 5, 0)
        );
    }

    #[test]
    fn a_controller_that_restarts_repeatedly_writes_only_its_counters() {
        let mut schedule = schedule();
        assert_eq!(schedule.due(Micros(1_999_999), true, true), DueWrite::Nothing);
        assert_eq!(schedule.due(seconds(2), true, true), DueWrite::Faults);
    }
}
