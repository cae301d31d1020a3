//! Whatever goes wrong in the firmware ends QEMU with a code and a reason; nothing waits for ever.

use std::time::{Duration, Instant};

use host_sim::pil::{PilError, PilOptions, PilSession, run_to_end};
use kou_tests::{pil_options, set_up};

fn provoke(what: &str) -> host_sim::pil::FirmwareExit {
    set_up(run_to_end(&PilOptions::of_binary("kou-qemu-provoke"), &["provoke", what]))
}

#[test]
fn qemu_panic_and_hardfault_exit_with_a_code() {
    let panic = provoke("panic");
    assert_eq!(panic.code, Some(101));
    assert!(panic.printed.contains("provoked panic"), "{}", panic.printed);
    assert!(panic.printed.contains("provoke.rs"), "{}", panic.printed);
    let fault = provoke("hardfault");
    assert_eq!(fault.code, Some(102));
    assert!(fault.printed.contains("hard fault at 0x"), "{}", fault.printed);
    let orderly = provoke("nothing");
    assert_eq!((orderly.code, orderly.printed.as_str()), (Some(0), ""));
}

#[test]
fn qemu_firmware_without_a_host_says_so_and_ends() {
    let ended = set_up(run_to_end(&pil_options(), &[]));
    assert_eq!(ended.code, Some(0));
    assert!(ended.printed.contains("nobody is on its link"), "{}", ended.printed);
    assert!(!ended.log.is_empty());
}

#[test]
fn qemu_silent_firmware_is_given_up_in_time() {
    // The provoking binary opens no line, so to a host that waits for hello it ends without a word.
    let start = Instant::now();
    let options =
        PilOptions { timeout: Duration::from_secs(20), ..PilOptions::of_binary("kou-qemu-provoke") };
    match PilSession::start(&options) {
        Err(PilError::Ended { code: Some(_), .. }) => {}
        other => panic!("{:?}", other.map(|_| "a session")),
    }
    assert!(start.elapsed() < Duration::from_secs(20));
}

#[test]
fn qemu_and_firmware_missing_are_said_with_the_command_that_helps() {
    let missing = PilOptions { qemu: "no-such-qemu".into(), ..pil_options() };
    let error = PilSession::start(&missing).err().expect("there is no such program").to_string();
    assert!(error.contains("apt-get install") && error.contains("no-such-qemu"), "{error}");
    let missing = PilOptions { firmware_elf: "no/such/firmware".into(), ..pil_options() };
    let error = PilSession::start(&missing).err().expect("there is no such file").to_string();
    assert!(error.contains("cargo build --release") && error.contains("no/such/firmware"), "{error}");
}

#[test]
fn qemu_firmware_ends_when_its_host_is_gone() {
    let session = set_up(PilSession::start(&pil_options()));
    assert_eq!(set_up(session.hang_up()).code, Some(3));
}
