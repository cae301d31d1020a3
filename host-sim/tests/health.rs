//! Health learned while driving, on simulated worlds: what it finds, what it must not find, and that its state is exact.

mod support;

use host_sim::calibration::SensorClass;
use host_sim::commands::evaluate::faults;
use host_sim::evaluate::{COMMISSIONING_H, Event, Run, Setting, World};
use kou_estimator::units::{Celsius, Megapascal, RevPerMin};
use kou_estimator::{State, state_record, step};
use support::{Folder, json};

fn setting() -> Setting {
    let folder = Folder::new();
    let out = folder.path("cal.toml");
    json([
        "identify",
        "--bench",
        "tests/data/bench_45.csv",
        "--machine",
        "host-sim/machines/reference.toml",
        "--model",
        "rom",
        "--class",
        "B",
        "--out",
        out.to_str().unwrap(),
        "--json",
    ]);
    let (calibration, params) = host_sim::calibration::read_checked(&out).unwrap();
    let law = &calibration.law;
    let limits = [law.n_max.get().into(), law.p_max.get().into(), law.t_max.get().into()];
    Setting { params, limits, class: SensorClass::B, misfit: 0.02, oil_ageing_per_h: 0.0, seed: 1000 }
}

/// Hours of a world with an event: commissioning, then an hour.
const HOURS: f64 = COMMISSIONING_H + 1.0;

#[test]
fn prop_leaks_are_reported_and_sensor_faults_are_never_confirmed_as_wear() {
    let setting = setting();
    let leak = |share: f64| setting.runs(20, HOURS, Some(Event::Leak { share, within_s: 60.0 }));
    let within =
        |runs: &[Run], limit_s: f64| runs.iter().filter(|r| r.delay_s.is_some_and(|d| d <= limit_s)).count();
    // 19 of 20, as 95 of 100; delays count seconds of judged driving. The 60 s within which the leak grows are in them.
    let (ten, thirty) = (leak(0.1), leak(0.3));
    println!("10 % within 10 min: {}; 30 % within 1 min: {}", within(&ten, 600.0), within(&thirty, 60.0));
    assert!(within(&ten, 600.0) >= 19);
    assert!(within(&thirty, 60.0) >= 19);
    // A drift of 1 % per hour, which takes 15 hours to reach the limit of 15 %.
    let drift = setting.runs(4, COMMISSIONING_H + 15.0, Some(Event::Drift { per_h: 0.01 }));
    println!("drift reported at {:?}", drift.iter().map(|r| r.level_at_report).collect::<Vec<_>>());
    assert!(drift.iter().all(|r| r.level_at_report.is_some_and(|level| level < 1.15)));
    for (name, fault) in faults(&setting) {
        let runs = setting.runs(10, HOURS, Some(Event::Sensor(fault)));
        assert!(runs.iter().all(|r| !r.wear), "{name} was confirmed as wear");
        // The report names what remains: whatever was reported has causes.
        assert!(runs.iter().all(|r| r.delay_s.is_none() || !r.remaining.is_empty()), "{name}");
    }
}

#[test]
fn prop_a_healthy_machine_is_left_in_peace_for_a_hundred_hours() {
    let run = setting().run(0, 100.0, None);
    println!(
        "level in its interval {} of {}, Kou {} of {}",
        run.level_hits, run.level_looks, run.kou_hits, run.kou_looks
    );
    assert_eq!(run.false_changes, 0);
    assert!(!run.false_wear);
}

#[test]
fn prop_intervals_of_level_and_kou_hold_the_truth_as_often_as_they_say() {
    // One world is one draw of the systematic errors, so coverage is counted over many worlds, not over long drives.
    let runs = setting().runs(200, 1.5, None);
    let share = |hits: fn(&Run) -> u32, looks: fn(&Run) -> u32| {
        runs.iter().map(|r| f64::from(hits(r))).sum::<f64>()
            / runs.iter().map(|r| f64::from(looks(r))).sum::<f64>()
    };
    let level = share(|r| r.level_hits, |r| r.level_looks);
    let kou = share(|r| r.kou_hits, |r| r.kou_looks);
    println!("95 % intervals: level {level:.3}, Kou {kou:.3}");
    // Demanded are 93 to 97 %. 200 worlds give a share of 0.95 to +-0.015, 1 sigma. In these first hours the level's interval
    // is on the safe side: it still holds what the recursion has not learned beside what no driving averages out.
    assert!((0.92..=0.99).contains(&level), "{level}");
    assert!((0.92..=0.98).contains(&kou), "{kou}");
}

/// CRC-32 of the calibration's record, as far as these tests care.
const CALIBRATION: u32 = 0x1234_5678;

#[test]
fn saving_and_restoring_at_any_sample_changes_no_bit_of_what_follows() {
    let setting = setting();
    let mut world = World::new(&setting.params, setting.limits, setting.class, setting.misfit, 7);
    let (mut straight, mut restored) = (State::new(), State::new());
    let mut bytes = [0_u8; state_record::MAX_LEN];
    let mut largest = 0;
    for i in 0..40_000 {
        if i == 20_000 {
            world.schedule(world.time_s(), Event::Leak { share: 0.5, within_s: 30.0 });
        }
        let (sample, _) = world.advance();
        let length = state_record::encode(&restored, CALIBRATION, &mut bytes).unwrap();
        largest = largest.max(length);
        restored = state_record::decode(&bytes[..length], CALIBRATION).unwrap();
        let one = step(&setting.params, &mut straight, &sample);
        let two = step(&setting.params, &mut restored, &sample);
        assert_eq!(one, two);
    }
    println!("state {} bytes, saved {largest}", size_of::<State>());
    assert!(straight.health().last_change().is_some(), "the run must go through a change as well");
    assert!(size_of::<State>() <= 1024);
}

/// Drives with hostile samples mixed in, and looks at what is told after every one and at the state now and then.
fn soak(samples: u32) {
    let setting = setting();
    let mut world = World::new(&setting.params, setting.limits, setting.class, setting.misfit, 9);
    let mut state = State::new();
    let (mut used, mut changes) = (0_u32, 0);
    for i in 0..samples {
        let (mut sample, _) = world.advance();
        // Stretches of good driving, so that there is something to spoil.
        match if i % 5000 < 1000 { i % 50 } else { 50 } {
            0 => sample.high_pressure.value = Ok(Megapascal(f32::NAN)),
            1 => sample.pump_speed.value = Ok(RevPerMin(f32::INFINITY)),
            // Wild, but within the sensor's range.
            2 => sample.motor_speed.value = Ok(RevPerMin(3400.0)),
            3 => sample.motor_speed.value = Ok(RevPerMin(1.0)),
            4 => sample.time.0 = u64::from(i),
            5 => sample.time.0 = u64::MAX,
            6 => sample.oil_temperature.value = Ok(Celsius(f32::MIN_POSITIVE)),
            7 => sample.pump_speed.value = Ok(RevPerMin(281.0)),
            _ => {}
        }
        // A motor speed that is wrong for minutes, so that changes are found as well.
        if i % 200_000 > 180_000
            && let Ok(n_m) = &mut sample.motor_speed.value
        {
            n_m.0 *= 0.97;
        }
        let health = step(&setting.params, &mut state, &sample).health;
        used += u32::from(health.gate.is_ok());
        changes = health.changes;
        let numbers = [health.level.get(), health.level_se.get(), health.ratio_offset.get()];
        assert!(numbers.iter().all(|n| n.is_finite()), "{i}: {health:?}");
        // Bounds of the learned parameters, and of the variance: 0.3^2, a day of drift, the systematic errors.
        assert!((0.0..25.0).contains(&health.level.get()), "{i}: {health:?}");
        assert!(health.level_se.get() > 0.0 && health.level_se.get() < 0.4, "{i}: {health:?}");
        assert!(health.ratio_offset.get().abs() <= 0.051, "{i}: {health:?}");
        if i % 1000 == 0 {
            assert!(state.health().is_sound(), "{i}: {state:?}");
        }
    }
    println!("{samples} samples, gate open for {used}, {changes} changes");
    assert!(used > samples / 20 && changes > 0, "nothing was learned that could be spoilt");
}

#[test]
fn prop_hostile_samples_leave_the_state_finite_bounded_and_positive_definite() {
    soak(1_000_000);
}

#[test]
#[ignore = "a hundred million samples take minutes: cargo test --release -p host-sim --test health -- --ignored"]
fn prop_a_hundred_million_hostile_samples_leave_the_state_sound() {
    soak(100_000_000);
}

#[test]
fn a_damaged_or_foreign_saved_state_is_refused() {
    let mut bytes = [0_u8; state_record::MAX_LEN];
    let length = state_record::encode(&State::new(), CALIBRATION, &mut bytes).unwrap();
    let good = &bytes[..length];
    for i in 0..length {
        for bit in 0..8 {
            let mut bad = good.to_vec();
            bad[i] ^= 1 << bit;
            assert!(state_record::decode(&bad, CALIBRATION).is_err(), "bit {bit} of byte {i}");
        }
        assert!(state_record::decode(&good[..i], CALIBRATION).is_err());
    }
    assert_eq!(
        state_record::decode(good, CALIBRATION + 1),
        Err(state_record::StateError::OtherCalibration(CALIBRATION))
    );
}
