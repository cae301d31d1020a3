//! The controller on the CAN bus: hostile frames ([`hostile`]), and its own frames against an independent decoder ([`capture`]).

mod capture;
mod hostile;
mod meaning;

use std::path::{Path, PathBuf};

use kou_app::diagnostics::{Dtc, FaultCode};
use kou_app::j1939::catalogue as c;
use kou_app::j1939::{Name, NameConfig};
use kou_estimator::units::Micros;
use kou_tests::TestKey;

const ADDRESS: u8 = 0x27;
const DRIVE: u8 = 0x03;
const TOOL: u8 = 0xF9;

fn ms(ms: u64) -> Micros {
    Micros(1000 * ms)
}

fn identity() -> NameConfig {
    NameConfig::transmission(0x12345)
}

fn name() -> Name {
    Name::new(&identity()).unwrap()
}

fn key() -> TestKey {
    TestKey::from_seed(0xC0FFEE)
}

fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

#[test]
fn every_dtc_message_and_reject_reason_is_documented() {
    let read = |name: &str| std::fs::read_to_string(workspace().join("docs").join(name)).unwrap();
    let (can, update) = (read("can.md"), read("calibration-update.md"));
    for code in FaultCode::all() {
        let Dtc { spn, fmi } = code.dtc();
        match code {
            FaultCode::Sensor(channel, fault) => {
                assert!(can.contains(&format!("| {spn} |\n")), "{channel:?}");
                assert!(can.contains(&format!("| {} | {fmi} |", fault.name())), "{fault:?}");
            }
            FaultCode::UpdateRefused(why) => {
                let row = format!("| {} | {} |", spn - 520_208, why.name());
                assert!(update.contains(&row), "{row}");
            }
            _ => assert!(can.contains(&format!("| {spn} | {fmi} |")), "{code:?}"),
        }
    }
    for message in c::ALL {
        let is_named = can.contains(&message.pgn.get().to_string());
        assert!(is_named, "{}", message.name);
    }
}
