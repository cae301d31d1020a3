//! Property tests over random input: the inverse model inverts the forward model; hostile input yields finite numbers
//! or a reason.

mod common;

use kou_estimator::model::flow_balance::{OperatingPoint, ReducedModel};
use kou_estimator::units::*;
use kou_estimator::{Calibration, record};
use kou_estimator::{Channel, Estimate, Fault, Params, Reading, Reason, Sample, State, step};
use proptest::prelude::*;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};
use rand_core::Rng;

/// Runner with a fixed seed, so that a run is reproducible bit for bit.
fn runner(cases: u32) -> TestRunner {
    let config = Config { cases, failure_persistence: None, ..Config::default() };
    TestRunner::new_with_rng(config, TestRng::from_seed(RngAlgorithm::ChaCha, &[7; 32]))
}

fn rng() -> TestRng {
    TestRng::from_seed(RngAlgorithm::ChaCha, &[42; 32])
}

fn reference_model() -> ReducedModel {
    let calibration = common::calibration();
    ReducedModel::new(&calibration.reduced, &calibration.oil).unwrap()
}

fn operating_point(n: f32, p: f32, t: f32, alpha: f32) -> OperatingPoint {
    OperatingPoint {
        pump_speed: RevPerMin(n),
        high_pressure: Megapascal(p),
        low_pressure: Megapascal(1.5),
        oil_temperature: Celsius(t),
        displacement: Ratio(alpha),
    }
}

/// Envelope of the flow balance: 1000-2800 r/min, 10-50 MPa, 30-90 degC, |alpha| 0.3-1, Kou 0.0015-0.36.
fn envelope() -> impl Strategy<Value = (f32, f32, f32, f32, f32)> {
    let alpha = prop_oneof![0.3_f32..=1.0, -1.0_f32..=-0.3];
    (1000.0_f32..=2800.0, 10.0_f32..=50.0, 30.0_f32..=90.0, alpha, 0.0015_f32..=0.36)
}

#[test]
fn prop_inverse_model_inverts_the_forward_model_over_the_envelope() {
    let model = reference_model();
    runner(200_000)
        .run(&envelope(), |(n, p, t, alpha, kou)| {
            let at = operating_point(n, p, t, alpha);
            let balance = model.balance(&at);
            // The envelope ends where leakage is a fifth of the flow: 0.2 of the leak-free ratio's magnitude.
            let leak_free = balance.ratio(LeakageCoefficient(0.0)).get().abs();
            let kou = kou.min(0.2 * leak_free * balance.kou_per_ratio());
            let ratio = balance.ratio(LeakageCoefficient(kou));
            let back = balance.kou(ratio).get();
            let bound = (1e-4 * kou).max(1e-5);
            prop_assert!((back - kou).abs() <= bound, "{at:?}: {kou} became {back}");
            Ok(())
        })
        .unwrap();
}

#[test]
fn prop_more_leakage_never_raises_the_magnitude_of_the_ratio() {
    let model = reference_model();
    runner(20_000)
        .run(&(envelope(), 0.0_f32..0.1), |((n, p, t, alpha, kou), more)| {
            let balance = model.balance(&operating_point(n, p, t, alpha));
            let less_leaky = balance.ratio(LeakageCoefficient(kou)).get();
            let leakier = balance.ratio(LeakageCoefficient(kou + more)).get();
            prop_assert!(leakier * alpha.signum() <= less_leaky * alpha.signum());
            Ok(())
        })
        .unwrap();
}

#[test]
fn prop_reversed_displacement_mirrors_the_ratio() {
    let model = reference_model();
    runner(20_000)
        .run(&envelope(), |(n, p, t, alpha, kou)| {
            let forward = model.balance(&operating_point(n, p, t, alpha)).ratio(LeakageCoefficient(kou));
            let backward = model.balance(&operating_point(n, p, t, -alpha)).ratio(LeakageCoefficient(kou));
            prop_assert_eq!(forward.get(), -backward.get());
            Ok(())
        })
        .unwrap();
}

/// Any f32: every bit pattern, special and plausible values often.
fn hostile(rng: &mut TestRng, scale: f32) -> f32 {
    match rng.next_u32() % 32 {
        0 => f32::from_bits(rng.next_u32()),
        1 => [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, -0.0, f32::MAX, f32::MIN, f32::MIN_POSITIVE]
            [rng.next_u32() as usize % 8],
        2 => -scale * unit(rng),
        _ => scale * unit(rng),
    }
}

fn unit(rng: &mut TestRng) -> f32 {
    rng.next_u32() as f32 / u32::MAX as f32
}

fn hostile_reading<U>(rng: &mut TestRng, now: u64, value: U) -> Reading<U> {
    let time = match rng.next_u32() % 48 {
        0 => rng.next_u64(),
        1 => now.wrapping_add(1),
        2 => now.saturating_sub(100_001),
        _ => now.saturating_sub(u64::from(rng.next_u32() % 100_000)),
    };
    if rng.next_u32().is_multiple_of(48) {
        Reading::failed(Micros(time), Fault::ALL[rng.next_u32() as usize % Fault::ALL.len()])
    } else {
        Reading::new(Micros(time), value)
    }
}

fn hostile_sample(rng: &mut TestRng, now: u64) -> Sample {
    let n_p = RevPerMin(hostile(rng, 3600.0));
    let n_m = RevPerMin(if rng.next_u32().is_multiple_of(2) {
        n_p.get() * (0.8 + 0.25 * unit(rng))
    } else {
        hostile(rng, 3600.0)
    });
    let p_h = Megapascal(hostile(rng, 62.0));
    let t_b = Celsius(hostile(rng, 140.0));
    Sample {
        time: Micros(if rng.next_u32().is_multiple_of(32) { rng.next_u64() } else { now }),
        pump_speed: hostile_reading(rng, now, n_p),
        motor_speed: hostile_reading(rng, now, n_m),
        high_pressure: hostile_reading(rng, now, p_h),
        low_pressure: if rng.next_u32().is_multiple_of(2) {
            Reading::not_fitted()
        } else {
            let p = Megapascal(hostile(rng, 3.0));
            hostile_reading(rng, now, p)
        },
        oil_temperature: hostile_reading(rng, now, t_b),
        displacement: if rng.next_u32().is_multiple_of(2) {
            Reading::not_fitted()
        } else {
            let a = Ratio(hostile(rng, 1.1));
            hostile_reading(rng, now, a)
        },
        flow: Reading::not_fitted(),
    }
}

/// Every number of the valid parts of an estimate.
fn numbers(estimate: &Estimate) -> Vec<f32> {
    let mut all = Vec::new();
    if let Ok(e) = estimate.expected {
        all.extend([
            e.kou.get(),
            e.kou_se.get(),
            e.ratio.get(),
            e.volumetric_efficiency.get(),
            e.leakage.get(),
        ]);
    }
    if let Ok(s) = estimate.observed {
        all.extend([
            s.kou.get(),
            s.kou_se.get(),
            s.ratio.get(),
            s.volumetric_efficiency.get(),
            s.leakage.get(),
        ]);
    }
    if let Ok(w) = estimate.wear_ratio() {
        all.push(w.get());
    }
    all
}

#[test]
fn prop_a_million_hostile_samples_give_finite_numbers_or_a_reason() {
    let params = Params::new(&common::calibration()).unwrap();
    let mut state = State::new();
    let mut rng = rng();
    let (mut both, mut rejected) = (0_u32, std::collections::BTreeMap::new());
    for i in 0..1_000_000_u64 {
        let sample = hostile_sample(&mut rng, 1_000_000 + i * 1000);
        let estimate = step(&params, &mut state, &sample);
        for number in numbers(&estimate) {
            assert!(number.is_finite(), "{sample:?} -> {estimate:?}");
        }
        both += u32::from(estimate.expected.is_ok() && estimate.observed.is_ok());
        if let Err(reason) = estimate.observed {
            *rejected.entry(format!("{reason:?}")).or_insert(0_u32) += 1;
        }
    }
    println!("valid {both}, rejected {rejected:?}");
    // The test must exercise both sides: a good share valid, and nearly every reason.
    assert!(both > 10_000, "{both}");
    assert!(rejected.len() > 40, "{}", rejected.len());
}

#[test]
fn prop_a_million_random_calibrations_are_rejected_or_valid() {
    let good = common::calibration();
    let mut bytes = [0_u8; record::calibration::MAX_LEN];
    let length = record::calibration::encode(&good, &mut bytes).unwrap();
    let bytes = &bytes[..length];
    let mut rng = rng();
    let (mut accepted, mut rejected_record, mut rejected_check) = (0_u32, 0_u32, 0_u32);
    let sample = common::sample(1_000_000);
    for i in 0..1_000_000_u32 {
        let mut candidate = bytes.to_vec();
        // One to three changed bits, mostly with the CRC recomputed so that the checks are reached.
        for _ in 0..=rng.next_u32() % 3 {
            let at = rng.next_u32() as usize % candidate.len();
            candidate[at] ^= 1 << (rng.next_u32() % 8);
        }
        if i % 8 != 0 {
            let body = candidate.len() - 4;
            let crc = record::crc32(&candidate[..body]).to_le_bytes();
            candidate[body..].copy_from_slice(&crc);
        }
        if i % 16 == 1 {
            candidate.truncate(rng.next_u32() as usize % (candidate.len() + 1));
        }
        let Ok(calibration) = record::calibration::decode(&candidate) else {
            rejected_record += 1;
            continue;
        };
        match Params::new(&calibration) {
            Err(error) => {
                rejected_check += 1;
                assert!(!error.field.is_empty());
            }
            Ok(params) => {
                accepted += 1;
                for number in numbers(&step(&params, &mut State::new(), &sample)) {
                    assert!(number.is_finite(), "{calibration:?}");
                }
            }
        }
    }
    println!(
        "accepted {accepted}, rejected as a record {rejected_record}, rejected by a check {rejected_check}"
    );
    assert!(accepted > 10_000 && rejected_record > 10_000 && rejected_check > 10_000);
}

#[test]
fn every_single_bit_flip_of_a_record_is_rejected() {
    let mut bytes = [0_u8; record::calibration::MAX_LEN];
    let length = record::calibration::encode(&common::calibration(), &mut bytes).unwrap();
    for bit in 0..length * 8 {
        let mut damaged = bytes[..length].to_vec();
        damaged[bit / 8] ^= 1 << (bit % 8);
        assert!(record::calibration::decode(&damaged).is_err(), "bit {bit}");
    }
}

#[test]
fn every_truncation_of_a_record_is_rejected() {
    let mut bytes = [0_u8; record::calibration::MAX_LEN];
    let length = record::calibration::encode(&common::calibration(), &mut bytes).unwrap();
    for cut in 0..length {
        assert!(record::calibration::decode(&bytes[..cut]).is_err(), "{cut}");
    }
    assert_eq!(record::calibration::decode(&bytes[..=length]), Err(record::RecordError::Excess));
}

#[test]
fn record_returns_every_bit_of_the_calibration() {
    let calibration: Calibration = common::calibration();
    let mut bytes = [0_u8; record::calibration::MAX_LEN];
    let length = record::calibration::encode(&calibration, &mut bytes).unwrap();
    println!("record of {length} bytes");
    assert_eq!(record::calibration::decode(&bytes[..length]).unwrap(), calibration);
    // Longest strings must fit as well.
    let mut longest = calibration;
    longest.machine.name = core::iter::repeat_n('m', 48).collect();
    longest.machine.serial = core::iter::repeat_n('s', 32).collect();
    longest.provenance.tool = core::iter::repeat_n('t', 32).collect();
    longest.provenance.date = core::iter::repeat_n('d', 16).collect();
    longest.provenance.points = u32::MAX;
    longest.provenance.bench_crc32 = u32::MAX;
    longest.provenance.machine_crc32 = u32::MAX;
    longest.limits.max_age_us = u32::MAX;
    let length = record::calibration::encode(&longest, &mut bytes).unwrap();
    println!("longest record of {length} bytes");
}

#[test]
fn each_reading_that_fails_gives_its_own_reason_and_recovers() {
    let params = Params::new(&common::calibration()).unwrap();
    let mut state = State::new();
    let mut now = 1_000_000;
    let mut run = |change: &dyn Fn(&mut Sample)| {
        now += 10_000;
        let mut sample = common::sample(now);
        change(&mut sample);
        step(&params, &mut state, &sample)
    };
    assert!(run(&|_| ()).wear_ratio().is_ok());
    for fault in Fault::ALL {
        let estimate = run(&|s| s.pump_speed.value = Err(fault));
        assert_eq!(estimate.expected, Err(Reason::Sensor(Channel::PumpSpeed, fault)));
        // Without the motor's speed the expected part is still valid.
        let estimate = run(&|s| s.motor_speed.value = Err(fault));
        assert!(estimate.expected.is_ok());
        assert_eq!(estimate.observed, Err(Reason::Sensor(Channel::MotorSpeed, fault)));
        assert!(run(&|_| ()).wear_ratio().is_ok());
    }
    type Edit<'a> = &'a dyn Fn(&mut Sample);
    let cases: [(Edit<'_>, Reason); 9] = [
        (
            &|s| s.high_pressure.value = Ok(Megapascal(f32::NAN)),
            Reason::Sensor(Channel::HighPressure, Fault::NotFinite),
        ),
        (
            &|s| s.high_pressure.value = Ok(Megapascal(310.0)),
            Reason::Sensor(Channel::HighPressure, Fault::OutOfRange),
        ),
        (
            &|s| s.oil_temperature.time = Micros(s.time.0 - 100_001),
            Reason::Sensor(Channel::OilTemperature, Fault::Stale),
        ),
        (
            &|s| s.oil_temperature.time = Micros(s.time.0 + 1),
            Reason::Sensor(Channel::OilTemperature, Fault::Future),
        ),
        (&|s| s.pump_speed.value = Ok(RevPerMin(299.0)), Reason::SpeedTooLow),
        (&|s| s.high_pressure.value = Ok(Megapascal(4.0)), Reason::NotLoaded),
        (&|s| s.displacement = Reading::new(s.time, Ratio(0.05)), Reason::DisplacementTooSmall),
        (&|s| s.motor_speed.value = Ok(RevPerMin(-1850.0)), Reason::RatioNotPositive),
        (&|s| s.motor_speed.value = Ok(RevPerMin(1990.0)), Reason::RatioAboveLeakFree),
    ];
    for (change, reason) in cases {
        assert_eq!(run(change).observed, Err(reason));
        assert!(run(&|_| ()).wear_ratio().is_ok(), "no recovery after {reason:?}");
    }
    assert_eq!(run(&|s| s.motor_speed.value = Ok(RevPerMin(100.0))).observed, Err(Reason::KouImplausible));
    assert_eq!(run(&|s| s.time = Micros(5)).observed, Err(Reason::TimeReversed));
    assert!(matches!(
        run(&|s| s.oil_temperature.value = Ok(Celsius(128.0))).expected,
        Err(Reason::OutsideRegion(_))
    ));
}

#[test]
fn exchanging_the_parameters_loses_no_sample_and_leaves_the_observed_part_unchanged() {
    let first = Params::new(&common::calibration()).unwrap();
    let mut other = common::calibration();
    other.law.c += 0.01;
    let other = Params::new(&other).unwrap();
    let (mut a, mut b) = (State::new(), State::new());
    for i in 0..100 {
        let sample = common::sample(1_000_000 + i * 10_000);
        let one = step(&first, &mut a, &sample);
        let two = step(if i % 2 == 0 { &first } else { &other }, &mut b, &sample);
        // The health status depends on the law; everything else does not.
        assert_eq!((a.samples(), a.valid()), (b.samples(), b.valid()));
        assert_eq!(one.observed, two.observed, "the observed part does not depend on the law");
    }
}
