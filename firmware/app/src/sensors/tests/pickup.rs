//! Speed measurement: accuracy over the whole range, robustness to single edges, time to zero, no panic.

use std::vec::Vec;

use kou_estimator::units::Micros;
use kou_estimator::{Fault, Reading};
use proptest::prelude::*;

use super::wheel::Wheel;
use crate::sensors::pickup::{Edges, PickupConfig, PickupParams, PickupState};
use crate::sensors::wiring;

const CONFIG: PickupConfig = wiring::REFERENCE.pump;

struct PickupBench {
    params: PickupParams,
    state: PickupState,
    wheel: Wheel,
    rpm: f64,
    ms: u64,
}

impl PickupBench {
    fn new(config: &PickupConfig, offset: u32) -> Self {
        Self {
            params: PickupParams::new(config).unwrap(),
            state: PickupState::new(),
            wheel: Wheel::new(config.teeth, u32::from(config.gap_teeth), offset),
            rpm: 0.0,
            ms: 0,
        }
    }

    /// One millisecond towards a new speed; `spoil` may change the edge times before they are stamped.
    fn step(&mut self, rpm: f64, spoil: impl FnOnce(&mut Vec<f64>)) -> Reading<f32> {
        let mut times = self.wheel.millisecond(self.rpm, rpm);
        self.rpm = rpm;
        self.ms += 1;
        spoil(&mut times);
        times.sort_by(f64::total_cmp);
        let mut edges = Edges::new();
        for time in times {
            edges.push(self.wheel.stamp(time));
        }
        let count = self.wheel.stamp(self.wheel.time_s());
        self.state.poll(&self.params, Micros(self.ms * 1000), count, &edges);
        self.reading()
    }

    fn reading(&self) -> Reading<f32> {
        let reading = self.state.reading(&self.params);
        Reading { time: reading.time, value: reading.value.map(|n| n.get()) }
    }

    fn run(&mut self, ms: u64, rpm: f64) -> Reading<f32> {
        for _ in 0..ms {
            self.step(rpm, |_| {});
        }
        self.reading()
    }
}

#[test]
fn speed_is_accurate_from_crawling_to_full_speed() {
    // Slowest first: 3 r/min is one tooth per 333 ms.
    for rpm in [3.0, 10.0, 60.0, 300.0, 999.23, 2000.0, 3000.0, 3499.0] {
        // Starts just before the counter wraps.
        let mut bench = PickupBench::new(&CONFIG, u32::MAX - 50_000_000);
        let reading = bench.run(8_000, rpm);
        let value = f64::from(reading.value.unwrap());
        // Two stamps of 0.1 us over at least the window of 50 ms, or over a pitch if that is longer.
        assert!((value / rpm - 1.0).abs() < 5e-6, "{rpm}: {value}");
        let age_us = bench.ms * 1000 - reading.time.0;
        assert!(age_us as f64 <= 60e6 / (60.0 * rpm) + 1.0, "{rpm}: {age_us} us old");
    }
}

#[test]
fn shaft_that_never_turned_is_at_standstill_after_zero_ms_and_unknown_before() {
    let mut bench = PickupBench::new(&CONFIG, 7);
    assert_eq!(bench.reading().value, Err(Fault::Missing));
    assert_eq!(bench.run(500, 0.0).value, Err(Fault::Missing));
    assert_eq!(bench.run(2, 0.0).value, Ok(0.0));
}

#[test]
fn shaft_that_stops_at_once_reads_zero_in_time_and_falls_until_then() {
    for rpm in [60.0, 1000.0, 3000.0] {
        let mut bench = PickupBench::new(&CONFIG, 0);
        bench.run(4_000, rpm);
        let mut last = bench.reading().value.unwrap();
        let mut stood = 0;
        for ms in 1..=600 {
            let value = bench.step(0.0, |_| {}).value.unwrap();
            assert!(value <= last * 1.001, "{rpm}: {value} after {last}");
            last = value;
            if value == 0.0 && stood == 0 {
                stood = ms;
            }
        }
        // Counted from the last edge, up to a pitch before the stop; polled each millisecond.
        let earliest = 499 - (60_000.0 / (60.0 * rpm)) as u64;
        assert!((earliest..=502).contains(&stood), "{rpm}: stood after {stood} ms");
    }
}

#[test]
fn reference_gap_is_counted_and_is_no_fault() {
    for gap_teeth in 1..=3 {
        let config = PickupConfig { gap_teeth, ..CONFIG };
        for rpm in [300.0, 1000.0, 3000.0] {
            let mut bench = PickupBench::new(&config, 0);
            bench.run(2_000, rpm);
            for _ in 0..1_000 {
                let value = f64::from(bench.step(rpm, |_| {}).value.unwrap());
                assert!((value / rpm - 1.0).abs() < 5e-6, "gap {gap_teeth}, {rpm}: {value}");
            }
        }
    }
}

#[test]
fn single_glitches_and_lost_edges_do_not_change_the_speed() {
    // Positions of a glitch within a pitch, and edges lost one by one, two by two.
    for place in [0.02, 0.2, 0.45, 0.55] {
        let mut bench = PickupBench::new(&CONFIG, 0);
        bench.run(2_000, 1000.0);
        let mut worst: f64 = 0.0;
        for ms in 0..5_000 {
            let reading = bench.step(1000.0, |edges| {
                if ms % 37 == 0
                    && let Some(&edge) = edges.first()
                {
                    edges.push(edge + place * 1e-3);
                }
                if ms % 41 == 5 {
                    edges.pop();
                }
            });
            worst = worst.max((f64::from(reading.value.unwrap()) / 1000.0 - 1.0).abs());
        }
        assert!(worst < 2e-5, "glitch at {place}: {worst}");
        let counts = bench.state.counts();
        assert!(counts.glitches > 100 && counts.gaps > 100, "{counts:?}");
        assert_eq!(counts.resyncs, 0);
    }
}

#[test]
fn glitch_late_in_a_pitch_changes_the_speed_by_less_than_a_pitch_of_the_window() {
    let mut bench = PickupBench::new(&CONFIG, 0);
    bench.run(2_000, 1000.0);
    let mut worst: f64 = 0.0;
    for ms in 0..5_000 {
        let reading = bench.step(1000.0, |edges| {
            if ms % 97 == 0
                && let Some(&edge) = edges.first()
            {
                edges.push(edge + 0.8e-3);
            }
        });
        worst = worst.max((f64::from(reading.value.unwrap()) / 1000.0 - 1.0).abs());
    }
    // Mistaken for the tooth, it moves one end of the window by 0.2 of 50 pitches.
    assert!(worst < 0.2 / 50.0 * 1.1, "{worst}");
}

#[test]
fn chattering_pickup_is_a_fault_and_heals() {
    let mut bench = PickupBench::new(&CONFIG, 0);
    bench.run(2_000, 1000.0);
    let mut named = 0;
    for ms in 1..=500 {
        // Every tooth gives two edges.
        let reading = bench.step(1000.0, |edges| {
            let more: Vec<_> = edges.iter().map(|edge| edge + 0.3e-3).collect();
            edges.extend(more);
        });
        if reading.value == Err(Fault::Rate) && named == 0 {
            named = ms;
        }
    }
    // Between 30 ms, when both edges of each tooth are bad, and 80 ms, when they alternate: the level's way to 4*60.
    assert!((30..=80).contains(&named), "{named}");
    // Healed after 600 good edges of 1 ms.
    assert!(bench.run(590, 1000.0).value.is_err());
    let value = bench.run(20, 1000.0).value.unwrap();
    assert!((value - 1000.0).abs() < 0.01, "{value}");
}

#[test]
fn shaft_that_spins_up_is_followed() {
    // From rest to 1900 r/min in 100 ms, as a motor does at a swash step; then constant.
    let mut bench = PickupBench::new(&CONFIG, 0);
    bench.run(600, 0.0);
    for ms in 1..=100 {
        let rpm = 19.0 * f64::from(ms);
        let reading = bench.step(rpm, |_| {});
        let value = f64::from(reading.value.unwrap());
        // The window of 50 ms covers the past: its mean lags by 25 ms of 19 r/min each, and never leads.
        assert!(value <= rpm + 1.0 && value >= rpm - 19.0 * 40.0, "{ms} ms: {value} for {rpm}");
    }
    let value = bench.run(60, 1900.0).value.unwrap();
    assert!((value / 1900.0 - 1.0).abs() < 1e-5, "{value}");
    assert!(bench.state.counts().resyncs <= 2, "{:?}", bench.state.counts());
}

#[test]
fn speed_above_the_maximum_is_out_of_range() {
    let mut bench = PickupBench::new(&CONFIG, 0);
    assert_eq!(bench.run(2_000, 3600.0).value, Err(Fault::OutOfRange));
}

#[test]
fn edges_lost_by_the_board_preserve_the_last_speed_with_its_time() {
    let mut bench = PickupBench::new(&CONFIG, 0);
    let before = bench.run(2_000, 1000.0);
    let mut edges = Edges::new();
    edges.overrun();
    bench.wheel.millisecond(1000.0, 1000.0);
    bench.ms += 1;
    let count = bench.wheel.stamp(bench.wheel.time_s());
    bench.state.poll(&bench.params, Micros(bench.ms * 1000), count, &edges);
    assert_eq!(bench.reading(), before);
    let after = bench.run(60, 1000.0);
    assert!((after.value.unwrap() - 1000.0).abs() < 0.01);
}

#[test]
fn configuration_out_of_range_is_rejected_by_name() {
    let reject = |change: fn(&mut PickupConfig)| {
        let mut config = CONFIG;
        change(&mut config);
        PickupParams::new(&config).unwrap_err().field
    };
    assert_eq!(reject(|c| c.teeth = 0), "teeth");
    assert_eq!(reject(|c| c.gap_teeth = 9), "gap_teeth");
    assert_eq!(reject(|c| c.max_rpm = f32::INFINITY), "max_rpm");
    assert_eq!(reject(|c| c.counter_hz = 1), "counter_hz");
    assert_eq!(reject(|c| c.window_ms = 0), "window_ms");
    assert_eq!(reject(|c| c.zero_ms = 0), "zero_ms");
    // 400 teeth at 20 000 r/min are 133 333 edges a second, too many for a counter of 100 kHz.
    let slow = |c: &mut PickupConfig| {
        c.teeth = 400;
        c.max_rpm = 20_000.0;
        c.counter_hz = 100_000;
    };
    assert_eq!(reject(slow), "counter_hz per tooth");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Speeds that change like a drive's, with single edges lost and added at random: a reading lies between the
    /// minimum and maximum speed within the window before its time stamp, and is seldom old.
    #[test]
    fn prop_speed_follows_a_drive_with_bad_edges(
        targets in prop::collection::vec(200.0..3000.0_f64, 3..8),
        seed in any::<u64>(),
        offset in any::<u32>(),
        gap_teeth in 0..=2_u8,
    ) {
        let config = PickupConfig { gap_teeth, ..CONFIG };
        let mut bench = PickupBench::new(&config, offset);
        let mut random = seed | 1;
        let mut next = move || {
            // xorshift64 (Marsaglia): cheap and repeatable.
            random ^= random << 13;
            random ^= random >> 7;
            random ^= random << 17;
            random
        };
        let mut rpm = targets[0];
        let (mut history, mut old, mut lost_ms) = (Vec::from([rpm]), 0, 0);
        for target in targets {
            for _ in 0..700 {
                // At most 8000 r/min per second.
                rpm += (target - rpm).clamp(-8.0, 8.0);
                history.push(rpm);
                // More than two consecutive lost edges are a longer gap than any declared one.
                let lose = next() % 50 == 0 && bench.ms > lost_ms + 5;
                let (spoil, at) = (next() % 50, (next() % 1000) as f64 * 1e-6);
                lost_ms = if lose { bench.ms } else { lost_ms };
                let reading = bench.step(rpm, |edges| match spoil {
                    _ if lose => { edges.pop(); }
                    0 => { if let Some(&edge) = edges.first() { edges.push(edge + at.min(0.9e-3)); } }
                    _ => {}
                });
                if bench.ms < 1000 {
                    continue;
                }
                let value = f64::from(reading.value.unwrap());
                let stamp_ms = (reading.time.0 / 1000) as usize;
                old += usize::from(bench.ms as usize - stamp_ms > 50);
                // The window, an eighth of it to its next end, and a pitch on either side.
                let span_ms = 57 + 2 * (1 + 60_000 / (60 * rpm as usize));
                let past = &history[stamp_ms.saturating_sub(span_ms)..=(stamp_ms + 1).min(history.len() - 1)];
                let slowest = past.iter().copied().fold(f64::INFINITY, f64::min);
                let fastest = past.iter().copied().fold(0.0, f64::max);
                // A glitch inside a gap may cost a pitch, and a window of so bad a wheel (one edge in fifty) may have
                // three such; a new window has at least six pitches, or lasts its 50 ms.
                let pitches = (slowest / 60.0 * 60.0 * 0.05).max(2.0);
                let band = 3.05 / if bench.state.fresh() { pitches.min(6.0) } else { pitches };
                let fits = value > slowest * (1.0 - band) && value < fastest * (1.0 + band);
                prop_assert!(fits, "{value}, not {slowest} to {fastest}, {band}, at {} ms", bench.ms);
            }
        }
        prop_assert!(old * 50 < history.len(), "{old} of {} readings older than 50 ms", history.len());
    }

    /// Arbitrary input: no panic, a finite speed within range, and zero after silence.
    #[test]
    fn prop_hostile_edges_give_a_speed_in_range_or_a_reason_and_silence_gives_zero(
        polls in prop::collection::vec(
            (0..5_000_000_u32, prop::collection::vec(any::<u32>(), 0..40), any::<bool>()), 1..200),
        gap_teeth in 0..=3_u8,
    ) {
        let params = PickupParams::new(&PickupConfig { gap_teeth, ..CONFIG }).unwrap();
        let mut state = PickupState::new();
        let (mut count, mut now) = (u32::MAX / 2, 0);
        let see = |state: &PickupState, now: u64| {
            let reading = state.reading(&params);
            if let Ok(n) = reading.value {
                assert!((0.0..=3500.0).contains(&n.get()), "{n}");
            }
            assert!(reading.time.0 <= now);
        };
        for (step, stamps, near) in polls {
            let mut edges = Edges::new();
            for stamp in stamps {
                // Half of them within the elapsed time, half anywhere.
                edges.push(if near { count.wrapping_add(stamp % step.max(1)) } else { stamp });
            }
            count = count.wrapping_add(step);
            now += u64::from(step) / 10;
            state.poll(&params, Micros(now), count, &edges);
            see(&state, now);
        }
        for _ in 0..501 {
            count = count.wrapping_add(10_000);
            now += 1000;
            state.poll(&params, Micros(now), count, &Edges::new());
            see(&state, now);
        }
        prop_assert_eq!(state.reading(&params).value.map(|n| n.get()), Ok(0.0));
    }
}
