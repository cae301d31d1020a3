//! Every message that is sent, captured and decoded by PyPI's cantools.

use std::path::{Path, PathBuf};
use std::process;

use kou_app::calibration::{CalibrationSource, CalibrationState};
use kou_app::diagnostics::{FaultCode, FaultMemory, FreezeFrame};
use kou_app::j1939::catalogue as c;
use kou_app::j1939::signal::{Message, Signal};
use kou_app::j1939::{DriveReadings, Frame, GLOBAL, Id, Node, Outputs, Pgn, Received};
use kou_app::update::wire::{UpdateAnswer, UpdateCommand};
use kou_app::update::{UpdateGuard, UpdateSession, UpdateTransfer};
use kou_estimator::health::Health;
use kou_estimator::units::Micros;
use kou_estimator::{Channel, Fault, State, step};
use kou_tests::samples::{HostileSamples, SplitMix64};
use kou_tests::{record_of, reference_calibration, reference_params};
use serde_json::{Map, Value, json};

use super::meaning::{meaning, meant};
use super::{ADDRESS, DRIVE, TOOL, key, ms, name, workspace};

/// A candump log, and the intended content of each frame: name of the message and value of each signal (a number, `null`
/// where not available, or the name of a state).
struct BusCapture {
    log: String,
    meant: Vec<Value>,
}

impl BusCapture {
    fn add(&mut self, now: Micros, frame: &Frame, message: &Message, signals: Map<String, Value>) {
        let data: String = frame.data().iter().map(|byte| format!("{byte:02X}")).collect();
        let seconds = now.0 as f64 * 1e-6;
        self.log += &format!("({seconds:.6}) can0 {:08X}#{data}\n", frame.id().raw());
        self.meant.push(json!({ "message": message.name, "signals": signals }));
    }
}

/// Twenty seconds on the bus, with every message that is sent.
fn capture() -> (BusCapture, Value) {
    let params = reference_params();
    let mut state = State::new();
    let mut samples = HostileSamples::new(11);
    let mut random = SplitMix64(5);
    let mut capture = BusCapture { log: String::new(), meant: Vec::new() };
    let mut node = Node::new(name(), ADDRESS);
    let mut faults = FaultMemory::new();
    let crc = 0xFEDC_BA98;
    let mut counter = 0;
    let mut lists: Vec<Value> = Vec::new();
    let mut was_announced = false;
    for tick in 0..2000_u64 {
        let now = ms(10 * tick);
        let sample = samples.next().unwrap();
        let estimate = step(&params, &mut state, &sample);
        let health: Health = estimate.health;
        // Diagnostic faults come one by one and go: single frames first, multi-packet lists later.
        match tick {
            400 => faults.confirm(FaultCode::Sensor(Channel::HighPressure, Fault::Open), FreezeFrame::at(4)),
            800 => faults.confirm(FaultCode::Wear, FreezeFrame::at(8)),
            1000 => faults.confirm(FaultCode::CalibrationLost, FreezeFrame::at(10)),
            1500 => faults.heal(FaultCode::Wear),
            _ => {}
        }
        for (at, pgn) in [(300, c::DM2.pgn), (1700, c::DM2.pgn), (350, Pgn::new(65253)), (360, c::DM1.pgn)] {
            if tick == at {
                let id = Id::new(6, c::REQUEST.pgn, ADDRESS, TOOL);
                let request = Frame::of(id, &pgn.to_le_bytes()).unwrap();
                capture.add(now, &request, &c::REQUEST, meant([(&c::REQUESTED_PGN, json!(pgn.get()))]));
                assert_eq!(node.receive(now, &request), Received::Handled);
            }
        }
        let outputs = Outputs {
            estimate: &estimate,
            health: Some(&health),
            calibration: CalibrationState { source: CalibrationSource::Stored, crc },
            dtcs: faults.reports(),
        };
        while let Some(frame) = node.poll(now, &outputs) {
            let (message, signals) = meaning(&frame, &outputs, &mut counter);
            if message.pgn == c::TP_CM.pgn {
                was_announced = true;
                let active = c::TP_PGN.raw(frame.full().unwrap()) == Ok(c::DM1.pgn.get());
                let troubles: Vec<Value> = faults
                    .entries()
                    .iter()
                    .filter(|entry| entry.active == active)
                    .map(|entry| json!([entry.dtc.spn, entry.dtc.fmi, entry.occurrences]))
                    .collect();
                lists.push(json!(troubles));
            }
            capture.add(now, &frame, message, signals);
        }
        // The drive's own messages, as readings that the firmware accepts.
        let mut drive = DriveReadings::new(None);
        let pressure = random.between(0.0, 60_000.0);
        let [n_p, n_m, t_b] =
            [random.between(0.0, 8000.0), random.between(0.0, 8000.0), random.between(-40.0, 150.0)];
        for (message, values) in [
            (&c::ETC1, vec![(&c::INPUT_SHAFT_SPEED, n_p), (&c::OUTPUT_SHAFT_SPEED, n_m)]),
            (&c::HPG, vec![(&c::HYDRAULIC_PRESSURE, pressure)]),
            (&c::TRF1, vec![(&c::OIL_TEMPERATURE, t_b)]),
        ] {
            let mut data = [0xFF; 8];
            values.iter().for_each(|(signal, value)| signal.put(&mut data, Ok(*value)));
            let frame = Frame::new(Id::new(message.priority, message.pgn, GLOBAL, DRIVE), data);
            assert!(drive.receive(now, &frame));
            // The value that the firmware decoded, not the one that was encoded.
            let decoded = |signal: &Signal| {
                json!(f64::from(match signal.spn {
                    Some(161) => drive.pump_speed(now).value.unwrap().get(),
                    Some(191) => drive.motor_speed(now, false).value.unwrap().get(),
                    Some(1762) => 1000.0 * drive.high_pressure(now).value.unwrap().get(),
                    _ => drive.oil_temperature(now).value.unwrap().get(),
                }))
            };
            let signals =
                values.iter().map(|(signal, _)| (signal.name.to_owned(), decoded(signal))).collect();
            capture.add(now, &frame, message, signals);
        }
    }
    capture_update(&mut capture, &node, ms(20_000));
    assert!(was_announced && lists.len() >= 5, "{}", lists.len());
    (capture, json!(lists))
}

/// A complete update and a rejected command, with the answers.
fn capture_update(capture: &mut BusCapture, node: &Node, begin: Micros) {
    let key = key();
    let record = record_of(&reference_calibration());
    let transfer = UpdateTransfer::new(&record, 1, key.key()).unwrap();
    let mut session = UpdateSession::new();
    let guard = UpdateGuard { loaded: false, keys: &key, counter: 0, machine: None };
    let bytes = |first: (&str, &str), data: &[u8; 8]| {
        let mut signals = Map::new();
        signals.insert(first.0.to_owned(), json!(first.1));
        for (place, byte) in data.iter().enumerate().skip(1) {
            signals.insert(format!("Byte{place}"), json!(byte));
        }
        signals
    };
    let commands = transfer.commands().chain([UpdateCommand::Abort, UpdateCommand::Next { number: 0 }]);
    for (number, command) in commands.enumerate() {
        let now = Micros(begin.0 + 1000 * number as u64);
        let data = command.to_bytes();
        let command_name = match command {
            UpdateCommand::Begin { .. } => "begin",
            UpdateCommand::Data { .. } => "data",
            UpdateCommand::Commit => "commit",
            UpdateCommand::Abort => "abort",
            UpdateCommand::Read { .. } => "read",
            UpdateCommand::Next { .. } => "next",
        };
        let frame = Frame::new(Id::new(7, c::UPDATE_COMMAND.pgn, ADDRESS, TOOL), data);
        capture.add(now, &frame, &c::UPDATE_COMMAND, bytes(("Command", command_name), &data));
        let mut outcome = session.receive(now, TOOL, data, &guard);
        if outcome.todo.is_some() {
            outcome = session.stored(true);
        }
        let (tool, answer) = outcome.answer.unwrap();
        let answer_name = match answer {
            UpdateAnswer::Begun => "begun",
            UpdateAnswer::SegmentAccepted { .. } => "taken",
            UpdateAnswer::Committed { .. } => "committed",
            UpdateAnswer::Aborted => "aborted",
            UpdateAnswer::ReadReady { .. } => "to be read",
            UpdateAnswer::Segment { .. } => "segment",
            UpdateAnswer::Rejected { .. } => "refused",
        };
        let data = answer.to_bytes();
        let frame = node.update_answer(tool, data).unwrap();
        capture.add(now, &frame, &c::UPDATE_ANSWER, bytes(("Answer", answer_name), &data));
    }
}

/// Python with cantools, as the set-up installs it.
fn cantools() -> Option<PathBuf> {
    let python = workspace().join("target/cantools/bin/python");
    let probe = process::Command::new(&python).args(["-c", "import cantools"]).output();
    probe.is_ok_and(|output| output.status.success()).then_some(python)
}

#[test]
fn val_cantools_decodes_every_frame_to_what_the_firmware_meant() {
    let (capture, lists) = capture();
    let Some(python) = cantools() else {
        println!("SKIPPED: no Python with cantools in target/cantools (`cargo xtask test` installs it)");
        return;
    };
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("can");
    std::fs::create_dir_all(&folder).unwrap();
    let (log, meant) = (folder.join("capture.log"), folder.join("meant.json"));
    std::fs::write(&log, &capture.log).unwrap();
    std::fs::write(&meant, json!({ "frames": capture.meant, "lists": lists }).to_string()).unwrap();
    let dbc = workspace().join("firmware/app/kou.dbc");
    let script = workspace().join("tests/can/check_with_cantools.py");
    let output = process::Command::new(python).arg(script).args([&dbc, &log, &meant]).output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout);
    println!("{text}");
    assert!(output.status.success(), "{text}\n{}", String::from_utf8_lossy(&output.stderr));
    let count = capture.meant.len();
    assert!(text.contains(&format!("{count} frames agree")), "{text}");
    assert!(count > 5000);
}
