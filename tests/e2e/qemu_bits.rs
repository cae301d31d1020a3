//! The firmware in QEMU and the host give the same bits.

use std::collections::BTreeMap;

use host_sim::pil::{self, same_bits};
use kou_estimator::units::Megapascal;
use kou_estimator::{Estimate, Fault, Params, Reason, State, step};
use kou_tests::samples::HostileSamples;
use kou_tests::{pil_options, record_of, reference_calibration, reference_params, set_up};

const SAMPLES: usize = 200_000;

fn name_of(estimate: &Estimate) -> String {
    let reason = match (&estimate.expected, &estimate.observed) {
        (Ok(_), Ok(_)) => return "valid".into(),
        (_, Err(reason)) | (Err(reason), _) => reason,
    };
    match reason {
        Reason::Sensor(channel, fault) => format!("{} {}", channel.name(), fault.name()),
        other => other.name().into(),
    }
}

#[test]
fn qemu_every_estimate_has_the_hosts_bits() {
    let params = reference_params();
    let mut state = State::new();
    let mut seen: BTreeMap<String, u64> = BTreeMap::new();
    let mut mismatches = Vec::new();
    let record = record_of(&reference_calibration());
    let samples = HostileSamples::new(1).take(SAMPLES);
    let report = set_up(pil::run(&pil_options(), &record, samples, |index, sample, target| {
        let host = step(&params, &mut state, sample);
        *seen.entry(name_of(&host)).or_default() += 1;
        if !same_bits(&host, target) && mismatches.len() < 5 {
            mismatches.push(format!("{index}: {sample:?}\nhost   {host:?}\ntarget {target:?}"));
        }
    }));
    // With `-icount shift=5` the firmware's clock counts 32 ns per instruction.
    let instructions = report.status.uptime_us as f64 * 1000.0 / 32.0 / SAMPLES as f64;
    println!(
        "{:.0} samples/s, {instructions:.0} instructions per sample over the link, stack {} B, {seen:?}",
        report.samples_per_s, report.status.stack_high_water_bytes
    );
    assert!(mismatches.is_empty(), "{}", mismatches.join("\n"));
    assert_eq!(report.samples, SAMPLES as u64);

    // The stream must be worth its name: every reason that this machine can have, and plenty of valid estimates.
    assert!(seen["valid"] > SAMPLES as u64 / 10, "{seen:?}");
    for fault in Fault::ALL {
        let name = format!("p_h {}", fault.name());
        assert!(seen.contains_key(&name), "no sample with {name}");
    }
    for reason in [
        "time_reversed",
        "speed_too_low",
        "displacement_too_small",
        "not_loaded",
        "outside_region",
        "ratio_not_positive",
        "ratio_above_leak_free",
        "kou_implausible",
    ] {
        assert!(seen.contains_key(reason), "no sample with {reason}: {seen:?}");
    }

    // The firmware counted what the host counted.
    let counts = report.status.counts;
    assert_eq!(counts.samples as usize, SAMPLES);
    assert_eq!(counts.estimates_valid, state.valid());
    assert_eq!(counts.estimates_valid + counts.estimates_rejected, counts.samples);
    assert_eq!(counts.frames_rejected(), 0);
    // Hello, calibration, status.
    assert_eq!(counts.frames_ok as usize, SAMPLES + 3);
}

#[test]
fn qemu_law_that_turns_negative_is_refused_with_the_hosts_bits() {
    let mut calibration = reference_calibration();
    // Negative where slow and cold, and large enough to stop the motor where hot and loaded.
    calibration.law.c = -0.08;
    calibration.law.a22 = 30.0;
    // Health needs a rated point at which the law holds.
    calibration.health.rated_pressure = Megapascal(6.0);
    let params = Params::new(&calibration).expect("a law may be negative somewhere");
    let mut state = State::new();
    let (mut negative, mut stops, mut mismatches) = (0, 0, 0);
    let samples = HostileSamples::new(2).take(5_000);
    set_up(pil::run(&pil_options(), &record_of(&calibration), samples, |_, sample, target| {
        let host = step(&params, &mut state, sample);
        negative += u32::from(host.expected == Err(Reason::LawNotPositive));
        stops += u32::from(host.expected == Err(Reason::LeakageTakesFlow));
        mismatches += u32::from(!same_bits(&host, target));
    }));
    assert_eq!(mismatches, 0);
    assert!(stops > 0 && negative == 0, "{negative} negative, {stops} stops");
}

#[test]
fn qemu_two_runs_have_the_same_firmware_time() {
    let record = record_of(&reference_calibration());
    let run = || {
        let samples = HostileSamples::new(3).take(20_000);
        set_up(pil::run(&pil_options(), &record, samples, |_, _, _| {})).status
    };
    let (first, second) = (run(), run());
    assert_eq!(first, second);
    assert!(first.uptime_us > 0 && first.counts.heartbeats > 0, "{first:?}");
}
