//! One analogue channel: each failure detected within its time, each healed, no value invented.

use std::vec::Vec;

use kou_estimator::Fault;
use kou_estimator::units::{Megapascal, Micros};
use proptest::prelude::*;

use crate::sensors::adc::{AdcCounts, ConversionError};
use crate::sensors::analog::{AnalogConfig, AnalogParams, AnalogState};
use crate::sensors::debounce::DebounceConfig;
use crate::sensors::scale::{LinearConfig, Scale};

/// 100 counts per MPa and more than 1000 counts of live zero, for round numbers.
const SCALE: LinearConfig<Megapascal> = LinearConfig::Ratiometric {
    supply_over_reference: 1.0,
    at_zero: Megapascal(0.0),
    at_span: Megapascal(32.768),
};

const CONFIG: AnalogConfig<Megapascal> = AnalogConfig {
    period_us: 1000,
    filter_s: 0.02,
    lowest: Megapascal(-0.5),
    highest: Megapascal(33.0),
    max_rate_per_s: 500.0,
    return_rate_per_s: None,
    noise_band: 1.0,
    stuck_ms: Some(300),
    debounce: DebounceConfig { confirm: 50, heal: 200 },
};

fn counts(mpa: f64) -> AdcCounts {
    AdcCounts::new((409.6 + 100.0 * mpa).round() as u16).unwrap()
}

struct AnalogBench {
    params: AnalogParams<Megapascal>,
    state: AnalogState,
    ms: u64,
}

impl AnalogBench {
    fn new() -> Self {
        let params = AnalogParams::new(Scale::pressure(&SCALE).unwrap(), &CONFIG).unwrap();
        Self { params, state: AnalogState::new(), ms: 0 }
    }

    fn feed(&mut self, conversion: Result<AdcCounts, ConversionError>) -> Result<f32, Fault> {
        self.ms += 1;
        self.state.observe(&self.params, Micros(self.ms * 1000), conversion, true);
        self.reading()
    }

    fn reading(&self) -> Result<f32, Fault> {
        self.state.reading::<Megapascal>().value.map(Megapascal::get)
    }

    /// Live signal: noise of a few counts.
    fn run(&mut self, ms: u64, mpa: f64) {
        for _ in 0..ms {
            let noise = 0.01 * ((self.ms % 5) as f64 - 2.0);
            self.feed(Ok(counts(mpa + noise))).ok();
        }
    }

    /// Milliseconds until the reading first satisfies `until`, with a constant supply of `conversion`.
    fn time_to(
        &mut self,
        mut conversion: impl FnMut(u64) -> Result<AdcCounts, ConversionError>,
        until: impl Fn(Result<f32, Fault>) -> bool,
    ) -> u64 {
        for ms in 1..100_000 {
            let now = conversion(self.ms);
            if until(self.feed(now)) {
                return ms;
            }
        }
        panic!("never");
    }
}

#[test]
fn live_signal_is_read_and_filtered() {
    let mut bench = AnalogBench::new();
    bench.run(500, 20.0);
    // The five noise values have zero mean; the filter leaves a fifth of a count.
    assert!((bench.reading().unwrap() - 20.0).abs() < 0.01, "{:?}", bench.reading());
    // A step within the permitted rate: 63 % after a time constant of 20 ms.
    let at = |bench: &mut AnalogBench, ms| {
        bench.run(ms, 20.9);
        bench.reading().unwrap()
    };
    let after = at(&mut bench, 20);
    assert!((after - (20.0 + 0.9 * 0.632)).abs() < 0.02, "{after}");
}

#[test]
fn every_failure_is_reported_and_healed_within_the_specified_time() {
    let just = |count: u16| move |_: u64| Ok(AdcCounts::new(count).unwrap());
    type Feed = std::boxed::Box<dyn FnMut(u64) -> Result<AdcCounts, ConversionError>>;
    let failures: [(Fault, u64, Feed); 6] = [
        (Fault::Open, 50, std::boxed::Box::new(just(0))),
        (Fault::Short, 50, std::boxed::Box::new(just(4000))),
        (Fault::OutOfRange, 50, std::boxed::Box::new(just(340))),
        (Fault::Missing, 50, std::boxed::Box::new(|_| Err(ConversionError::NoAnswer))),
        // 300 ms of one value, then the debounce; the change to it counts as the first of the same.
        (Fault::Stuck, 351, std::boxed::Box::new(move |_| Ok(counts(20.0)))),
        // Noise of 8 MPa at 500 Hz: every other conversion is too far from the accepted ones, so the level rises by
        // three in 2 ms: 134 ms to 4*50.
        (Fault::Rate, 135, std::boxed::Box::new(|ms| Ok(counts(if ms % 2 == 0 { 20.0 } else { 28.0 })))),
    ];
    for (fault, within_ms, mut feed) in failures {
        let mut bench = AnalogBench::new();
        bench.run(500, 20.0);
        let ms = bench.time_to(&mut feed, |reading| reading.is_err());
        assert_eq!(bench.reading(), Err(fault));
        assert!(ms <= within_ms, "{fault:?} after {ms} ms");
        for _ in 0..1000 {
            let now = feed(bench.ms);
            assert!(bench.feed(now).is_err(), "{fault:?} was forgiven while it lasted");
        }
        let live = |ms: u64| Ok(counts(15.0 + 0.01 * (ms % 5) as f64));
        let ms = bench.time_to(live, |reading| reading.is_ok());
        // 200 good ones, preceded by one or two that are still compared with the last outlier.
        assert!(ms <= 202, "{fault:?} healed after {ms} ms");
        assert!((bench.reading().unwrap() - 15.02).abs() < 0.05, "{fault:?}: {:?}", bench.reading());
    }
}

#[test]
fn jump_beyond_the_machines_rate_is_rejected_and_then_accepted() {
    let mut bench = AnalogBench::new();
    bench.run(500, 10.0);
    // 15 MPa further: 28 ms at 500 MPa/s and 1 MPa of band, which is shorter than the debounce.
    for ms in 1..=27 {
        let before = bench.reading();
        let noise = 0.01 * (ms % 3) as f64;
        assert_eq!(bench.feed(Ok(counts(25.0 + noise))), before, "{ms}");
    }
    bench.run(200, 25.0);
    assert!((bench.reading().unwrap() - 25.0).abs() < 0.02);
}

#[test]
fn until_a_failure_is_confirmed_the_reading_keeps_value_and_time_of_the_last_good_one() {
    let mut bench = AnalogBench::new();
    bench.run(500, 20.0);
    let good = bench.state.reading::<Megapascal>();
    for _ in 0..49 {
        bench.feed(Err(ConversionError::Bus)).ok();
        assert_eq!(bench.state.reading::<Megapascal>(), good);
    }
    assert_eq!(bench.feed(Err(ConversionError::Bus)), Err(Fault::Missing));
}

#[test]
fn constant_signal_at_rest_is_not_stuck() {
    let mut bench = AnalogBench::new();
    for ms in 1..5000 {
        bench.state.observe(&bench.params, Micros(ms * 1000), Ok(counts(0.0)), false);
    }
    assert!(bench.reading().is_ok());
}

#[test]
fn before_the_first_conversion_the_reading_is_missing() {
    assert_eq!(AnalogBench::new().reading(), Err(Fault::Missing));
}

#[test]
fn configuration_out_of_range_is_rejected_by_name() {
    let reject = |change: fn(&mut AnalogConfig<Megapascal>)| {
        let mut config = CONFIG;
        change(&mut config);
        AnalogParams::new(Scale::pressure(&SCALE).unwrap(), &config).unwrap_err().field
    };
    assert_eq!(reject(|c| c.period_us = 0), "period_us");
    assert_eq!(reject(|c| c.filter_s = f32::NAN), "filter_s");
    assert_eq!(reject(|c| c.highest = c.lowest), "highest");
    assert_eq!(reject(|c| c.max_rate_per_s = 0.0), "max_rate_per_s");
    assert_eq!(reject(|c| c.noise_band = -1.0), "noise_band");
    assert_eq!(reject(|c| c.stuck_ms = Some(1)), "stuck_ms");
    assert_eq!(reject(|c| c.debounce.confirm = 0), "debounce.confirm");
    assert_eq!(reject(|c| c.debounce.heal = 70_000), "debounce.heal");
}

proptest! {
    #[test]
    fn prop_whatever_comes_the_reading_is_finite_in_range_and_never_from_the_future(
        feed in prop::collection::vec((any::<Option<u16>>(), 0..5_000_u64, any::<bool>()), 1..400),
    ) {
        let mut bench = AnalogBench::new();
        let mut now = 1_000_000_u64;
        let feed: Vec<_> = feed;
        for (raw, step, live) in feed {
            // Occasionally the clock stops or goes back.
            now = if step == 0 { now.saturating_sub(500) } else { now + step };
            let conversion = raw.and_then(|raw| AdcCounts::new(raw % 5000)).ok_or(ConversionError::Bus);
            bench.state.observe(&bench.params, Micros(now), conversion, live);
            let reading = bench.state.reading::<Megapascal>();
            if let Ok(value) = reading.value {
                prop_assert!((-0.5..=33.0).contains(&value.get()), "{value}");
            }
            prop_assert!(reading.time.0 <= now + 500);
        }
    }
}

#[test]
fn persistent_jump_is_a_fault_until_the_quantity_could_have_moved_there() {
    let config = AnalogConfig { max_rate_per_s: 20.0, return_rate_per_s: Some(2.0), ..CONFIG };
    let params = AnalogParams::new(Scale::pressure(&SCALE).unwrap(), &config).unwrap();
    let mut bench = AnalogBench { params, ..AnalogBench::new() };
    bench.run(500, 5.0);
    // 9 MPa at 2 MPa/s minus a noise band of 1 MPa takes 4 s; then half of that to heal, as always.
    bench.run(100, 14.0);
    assert_eq!(bench.reading(), Err(Fault::Rate));
    bench.run(3800, 14.0);
    assert_eq!(bench.reading(), Err(Fault::Rate));
    bench.run(400, 14.0);
    assert!(bench.reading().is_ok());
    // A return to the previous value is no jump, whatever other fault there was.
    bench.run(100, 30.0);
    assert_eq!(bench.reading(), Err(Fault::Rate));
    bench.run(250, 14.0);
    assert!(bench.reading().is_ok());
}
