//! Storage, frames and authentication tag on the target: the same code as on the host, so the same bits.

use host_sim::pil::{PilOptions, run_to_end};
use kou_app::j1939::publish;
use kou_app::update::{Key, mac};
use kou_estimator::calibration::record::crc32;
use kou_estimator::units::{LeakageCoefficient, LitrePerMin, Micros, Ratio};
use kou_estimator::{Channel, Estimate, Expected, Fault, Reason};
use kou_tests::set_up;

#[test]
fn qemu_storage_survives_power_cuts_and_frames_and_tag_are_the_hosts() {
    let ended = set_up(run_to_end(&PilOptions::of_binary("kou-qemu-keep"), &[]));
    assert_eq!(ended.code, Some(0), "{}", ended.printed);
    println!("{}", ended.printed);
    let words: Vec<&str> = ended.printed.split_whitespace().collect();
    let value = |name: &str| {
        let at = words.iter().position(|word| *word == name).expect("the binary prints it");
        words[at + 1]
    };
    let cuts: u32 = value("cuts").parse().unwrap();
    assert!(cuts > 200, "{cuts}");
    let estimate = Estimate {
        time: Micros(0),
        expected: Ok(Expected {
            kou: LeakageCoefficient(0.08),
            kou_se: LeakageCoefficient(0.002),
            ratio: Ratio(0.95),
            volumetric_efficiency: Ratio(0.95),
            leakage: LitrePerMin(12.5),
        }),
        seen: Err(Reason::Sensor(Channel::MotorSpeed, Fault::Stuck)),
        health: kou_estimator::health::Health::new(),
    };
    let parts =
        [publish::leakage(&estimate), publish::efficiency(&estimate), publish::validity(&estimate, 7)];
    assert_eq!(value("frames"), format!("{:08x}", crc32(parts.as_flattened())));
    let tag = mac::tag(&Key::new([7; 32]), 1, b"record").unwrap();
    assert_eq!(value("tag"), format!("{:08x}", crc32(&tag)));
}
