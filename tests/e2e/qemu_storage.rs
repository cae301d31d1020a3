//! Storage, frames and authentication tag on the target: the same code as on the host, so the same bits.

use host_sim::pil::{PilOptions, run_to_end};
use kou_emulation::examples;
use kou_estimator::record::crc32;
use kou_tests::set_up;

#[test]
fn qemu_storage_survives_power_cuts_and_frames_and_tag_are_the_hosts() {
    let ended = set_up(run_to_end(&PilOptions::of_binary("kou-qemu-storage-check"), &[]));
    assert_eq!(ended.code, Some(0), "{}", ended.printed);
    println!("{}", ended.printed);
    let words: Vec<&str> = ended.printed.split_whitespace().collect();
    let value = |name: &str| {
        let at = words.iter().position(|word| *word == name).expect("the binary prints it");
        words[at + 1]
    };
    let cuts: u32 = value("cuts").parse().unwrap();
    assert!(cuts > 200, "{cuts}");
    let frames = crc32(examples::example_frames().as_flattened());
    assert_eq!(value("frames"), format!("{frames:08x}"));
    assert_eq!(value("tag"), format!("{:08x}", crc32(&examples::example_tag().unwrap())));
}
