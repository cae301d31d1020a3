//! The controller on the CAN bus: what hostile frames can do, and what an independent decoder makes of its own.

use std::path::{Path, PathBuf};
use std::process::Command as Program;

use embassy_futures::block_on;
use kou_app::faults::{Code, Dtc, Entry, FaultMemory, Snapshot};
use kou_app::j1939::catalogue as c;
use kou_app::j1939::signal::{Message, Signal};
use kou_app::j1939::{
    CalibrationSource, CalibrationState, DriveReadings, Frame, GLOBAL, Id, Name, NameConfig, Node, Outputs,
    Pgn, Received,
};
use kou_app::storage::{MIN_BYTES, RamFlash, Store, StoredCalibration};
use kou_app::update::wire::{Answer, Command};
use kou_app::update::{Guard, Key, KeySource, Machine, Refusal, Session, Todo, Transfer};
use kou_estimator::health::{Health, HealthConfig, HealthParams, HealthState, observe};
use kou_estimator::units::Micros;
use kou_estimator::{Channel, Estimate, Fault, Reason, State, step};
use kou_tests::samples::{Random, Samples};
use kou_tests::{record_of, reference_calibration, reference_params};
use serde_json::{Map, Value, json};

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

struct TestKey(Key);

impl KeySource for TestKey {
    fn update_key(&self) -> Option<Key> {
        Some(self.0.clone())
    }
}

fn key() -> TestKey {
    let mut random = Random(0xC0FFEE);
    TestKey(Key::new(std::array::from_fn(|_| random.bits() as u8)))
}

/// A node that has claimed its address by `now`.
fn claimed(now: u64, outputs: &Outputs<'_>) -> Node {
    let mut node = Node::new(name(), ADDRESS);
    for t in [now - 300, now - 1, now] {
        while node.poll(ms(t), outputs).is_some() {}
    }
    assert_eq!(node.address(), Some(ADDRESS));
    node
}

/// A frame that somebody might send to do harm.
fn hostile(random: &mut Random, genuine: &[Frame], address: u8) -> Frame {
    let data = random.bits().to_le_bytes();
    let len = if random.once_in(3) { random.below(9) } else { 8 };
    let groups = [
        c::ETC1.pgn,
        c::HPG.pgn,
        c::TRF1.pgn,
        c::REQUEST.pgn,
        c::ADDRESS_CLAIMED.pgn,
        c::UPDATE_COMMAND.pgn,
        c::TP_CM.pgn,
        c::TP_DT.pgn,
        c::DM1.pgn,
        Pgn::new(65240),
    ];
    let source = [DRIVE, TOOL, address, random.bits() as u8][random.below(4)];
    let destination = [address, GLOBAL, random.bits() as u8][random.below(3)];
    match random.below(4) {
        0 => Frame::of(Id::from_raw(random.bits() as u32), &data[..len]).unwrap(),
        // Recorded frames of an update that was accepted once, some with a flipped bit.
        1 => {
            let frame = genuine[random.below(genuine.len())];
            let mut bytes: [u8; 8] = frame.data().try_into().unwrap();
            if random.once_in(2) {
                bytes[random.below(8)] ^= 1 << random.below(8);
            }
            Frame::of(Id::new(7, frame.id().pgn(), address, source), &bytes[..len]).unwrap()
        }
        // The whole alphabet of update commands.
        2 => {
            let mut bytes = data;
            bytes[0] = [1, 2, 3, 4, 0x11, 0x12][random.below(6)];
            bytes[1] = if bytes[0] == 1 { 1 } else { random.below(4) as u8 };
            bytes[3] &= 3;
            Frame::of(Id::new(7, c::UPDATE_COMMAND.pgn, address, source), &bytes[..len]).unwrap()
        }
        _ => Frame::of(Id::new(6, groups[random.below(groups.len())], destination, source), &data[..len])
            .unwrap(),
    }
}

fn quiet<'a>(estimate: &'a Estimate, faults: &'a FaultMemory) -> Outputs<'a> {
    Outputs { estimate, health: None, calibration: CalibrationState::default(), faults }
}

#[test]
fn prop_a_million_hostile_frames_change_no_state_that_they_may_not() {
    let key = key();
    let calibration = reference_calibration();
    let record = record_of(&calibration);
    let machine =
        Machine { name: calibration.machine.name.clone(), serial: calibration.machine.serial.clone() };
    let counter = 9;
    // What the attacker recorded: the last accepted update, and one of it begun under a newer counter.
    let transfer = Transfer::new(&record, counter, &key.0).unwrap();
    let mut genuine: Vec<Frame> = transfer
        .commands()
        .map(|command| Frame::new(Id::new(7, c::UPDATE_COMMAND.pgn, ADDRESS, TOOL), command.to_bytes()))
        .collect();
    let mut newer = *genuine[0].data().first_chunk::<8>().unwrap();
    newer[4] = counter as u8 + 1;
    genuine[0] = Frame::new(genuine[0].id(), newer);

    let mut store = Store::new(RamFlash::<{ MIN_BYTES as usize }, 2048>::new(), 0..MIN_BYTES).unwrap();
    block_on(store.write(&StoredCalibration { counter, record: &record })).unwrap();
    let cells = *store.flash().cells();

    let estimate = Estimate::invalid(Micros(0), Reason::NotLoaded);
    let mut faults = FaultMemory::new();
    let mut random = Random(1);
    let mut session = Session::new();
    let mut drive = DriveReadings::new(Some(DRIVE));
    let mut node = claimed(1000, &quiet(&estimate, &faults));
    let (mut replay, mut refusals, mut readings, mut lost, mut begun) = (0, 0_u32, 0_u32, 0_u32, 0_u32);
    for number in 0..1_000_000_u64 {
        let now = ms(1000 + number);
        // Now and then the attacker plays the recording from its beginning.
        let frame = if replay > 0 || random.once_in(2000) {
            let frame = genuine[replay];
            replay = (replay + 1) % genuine.len();
            frame
        } else {
            hostile(&mut random, &genuine, ADDRESS)
        };
        let before = drive.clone();
        let is_reading = drive.receive(now, &frame);
        let may_read = frame.id().source() == DRIVE
            && frame.data().len() == 8
            && [c::ETC1.pgn, c::HPG.pgn, c::TRF1.pgn].contains(&frame.id().pgn());
        assert_eq!(is_reading, may_read, "{frame:?}");
        assert!(may_read || drive == before, "{frame:?}");
        readings += u32::from(is_reading);
        let value = drive.high_pressure(now).value;
        assert!(value.is_err() || (0.0..=128.51).contains(&value.unwrap().get()));

        let received = node.receive(now, &frame);
        if let Received::Update { source, data } = received {
            let guard = Guard { loaded: false, keys: &key, counter, machine: Some(&machine) };
            let outcome = session.receive(now, source, data, &guard);
            match outcome.todo {
                Some(Todo::Store { .. }) => panic!("{frame:?} led to a write"),
                Some(Todo::Fill(_)) => {
                    assert!(session.fill(now, |_| None).refused.is_some());
                }
                None => {}
            }
            begun += u32::from(outcome.answer.is_some() && outcome.refused.is_none());
            refusals += u32::from(outcome.refused.is_some());
            if let Some(why) = outcome.refused {
                faults.happened(Code::UpdateRefused(why), Snapshot::at(0));
            }
        }
        session.poll(now);
        assert!(session.record().is_empty());
        // Whatever came, no more than a few frames go out for it, all under the controller's own address.
        for sent in 0.. {
            let Some(frame) = node.poll(now, &quiet(&estimate, &faults)) else { break };
            assert!(sent < 20, "a flood answered by a flood");
            let is_claim = frame.id().pgn() == c::ADDRESS_CLAIMED.pgn;
            assert!(is_claim || Some(frame.id().source()) == node.address());
        }
        if node.address() != Some(ADDRESS) {
            // Only a whole claim of this very address by a smaller name may do that.
            let is_claim = frame.id().pgn() == c::ADDRESS_CLAIMED.pgn && frame.id().source() == ADDRESS;
            assert!(is_claim && Name::from_bytes(frame.data().try_into().unwrap()) < name(), "{frame:?}");
            lost += 1;
            node = claimed(1000 + number, &quiet(&estimate, &faults));
        }
    }
    assert!(*store.flash().cells() == cells, "flash is untouched");
    // Also the last gate was reached: a whole recording under a newer counter, stopped by its tag.
    assert!(faults.get(Code::UpdateRefused(Refusal::Mac)).is_some());
    println!("{readings} readings, {refusals} refusals, {begun} steps taken, address lost {lost} times");
    // The attack reached everything that it was meant to reach.
    assert!(readings > 1000 && refusals > 100_000 && begun > 1000 && lost > 100);
}

/// What one frame was meant to say: name of the message, and each signal's number, `null` where not available, or the
/// name of its state.
struct Capture {
    log: String,
    meant: Vec<Value>,
}

impl Capture {
    fn add(&mut self, now: Micros, frame: &Frame, message: &Message, signals: Map<String, Value>) {
        let data: String = frame.data().iter().map(|byte| format!("{byte:02X}")).collect();
        let seconds = now.0 as f64 * 1e-6;
        self.log += &format!("({seconds:.6}) can0 {:08X}#{data}\n", frame.id().raw());
        self.meant.push(json!({ "message": message.name, "signals": signals }));
    }
}

fn meant<const N: usize>(signals: [(&Signal, Value); N]) -> Map<String, Value> {
    signals.into_iter().map(|(signal, value)| (signal.name.to_owned(), value)).collect()
}

/// A number as the firmware holds it; "error" where the signal cannot hold it.
fn number(signal: &Signal, value: Option<f32>) -> Value {
    let (min, max) = signal.range();
    match value {
        None => Value::Null,
        Some(value) if value >= min && value <= max => json!(f64::from(value)),
        Some(_) => json!({ "error": true }),
    }
}

fn reason_name(reason: Option<Reason>) -> Value {
    json!(match reason {
        None => "valid".to_owned(),
        Some(Reason::OutsideRegion(direction)) => {
            // Named as the estimator's own reports do, in words.
            let text = format!("{direction:?}");
            let words: String = text
                .chars()
                .flat_map(|ch| if ch.is_uppercase() { vec![' ', ch.to_ascii_lowercase()] } else { vec![ch] })
                .collect();
            format!("outside region:{}", words.replace("plus", "+").replace("minus", "-"))
        }
        Some(Reason::KouImplausible) => "Kou implausible".to_owned(),
        Some(reason) => reason.name().replace('_', " "),
    })
}

fn sensor_of(reason: Option<Reason>) -> (Value, Value) {
    let text = |name: &str| match name {
        "n_p" => "pump speed",
        "n_m" => "motor speed",
        "p_h" => "high pressure",
        "p_l" => "low pressure",
        "t_b" => "oil temperature",
        "alpha" => "displacement",
        other => panic!("{other}"),
    };
    match reason {
        Some(Reason::Sensor(Channel::Flow, fault)) => (json!("flow"), json!(fault.name().replace('_', " "))),
        Some(Reason::Sensor(channel, fault)) => {
            (json!(text(channel.name())), json!(fault.name().replace('_', " ")))
        }
        _ => (Value::Null, Value::Null),
    }
}

fn trouble_of(entry: Option<&Entry>, lamp: bool) -> Map<String, Value> {
    let (Dtc { spn, fmi }, count) =
        entry.map_or((Dtc { spn: 0, fmi: 0 }, 0), |entry| (entry.dtc, entry.occurrences));
    let mut signals = meant([
        (&c::PROTECT_LAMP, json!("off")),
        (&c::RED_LAMP, json!("off")),
        (&c::MALFUNCTION_LAMP, json!("off")),
        (&c::AMBER_LAMP, json!(if lamp { "on" } else { "off" })),
        (&c::DTC_SPN_LOW, json!(spn & 0xFFFF)),
        (&c::DTC_SPN_HIGH, json!(spn >> 16)),
        (&c::DTC_FMI, json!(fmi)),
        (&c::DTC_COUNT, json!(count)),
        (&c::DTC_METHOD, json!(0)),
    ]);
    for flash in ["FlashProtectLamp", "FlashAmberWarningLamp", "FlashRedStopLamp", "FlashMalfunctionLamp"] {
        signals.insert(flash.to_owned(), Value::Null);
    }
    signals
}

/// What a frame of the node was meant to say, from what it was given.
fn meaning(frame: &Frame, outputs: &Outputs<'_>, counter: &mut u8) -> (&'static Message, Map<String, Value>) {
    let estimate = outputs.estimate;
    let (expected, seen) = (estimate.expected.ok(), estimate.seen.ok());
    let n = number;
    let pgn = frame.id().pgn();
    if pgn == c::LEAKAGE.pgn {
        let signals = meant([
            (&c::KOU_EXPECTED, n(&c::KOU_EXPECTED, expected.map(|e| e.kou.get()))),
            (&c::KOU_EXPECTED_SE, n(&c::KOU_EXPECTED_SE, expected.map(|e| e.kou_se.get()))),
            (&c::KOU_SEEN, n(&c::KOU_SEEN, seen.map(|s| s.kou.get()))),
            (&c::KOU_SEEN_SE, n(&c::KOU_SEEN_SE, seen.map(|s| s.kou_se.get()))),
        ]);
        (&c::LEAKAGE, signals)
    } else if pgn == c::EFFICIENCY.pgn {
        let percent = |ratio: f32| 100.0 * ratio;
        let by_law = expected.map(|e| percent(e.volumetric_efficiency.get()));
        let measured = seen.map(|s| percent(s.volumetric_efficiency.get()));
        let signals = meant([
            (&c::EFFICIENCY_EXPECTED, n(&c::EFFICIENCY_EXPECTED, by_law)),
            (&c::EFFICIENCY_SEEN, n(&c::EFFICIENCY_SEEN, measured)),
            (&c::FLOW_EXPECTED, n(&c::FLOW_EXPECTED, expected.map(|e| e.leakage.get()))),
            (&c::FLOW_SEEN, n(&c::FLOW_SEEN, seen.map(|s| s.leakage.get()))),
        ]);
        (&c::EFFICIENCY, signals)
    } else if pgn == c::VALIDITY.pgn {
        *counter = counter.wrapping_add(1);
        let (expected_channel, expected_fault) = sensor_of(estimate.expected.err());
        let (seen_channel, seen_fault) = sensor_of(estimate.seen.err());
        let wear = estimate.wear_ratio().ok().map(|ratio| ratio.get());
        let signals = meant([
            (&c::EXPECTED_REASON, reason_name(estimate.expected.err())),
            (&c::EXPECTED_CHANNEL, expected_channel),
            (&c::EXPECTED_FAULT, expected_fault),
            (&c::SEEN_REASON, reason_name(estimate.seen.err())),
            (&c::SEEN_CHANNEL, seen_channel),
            (&c::SEEN_FAULT, seen_fault),
            (&c::WEAR_RATIO, n(&c::WEAR_RATIO, wear)),
            (&c::ESTIMATE_COUNTER, json!(*counter)),
        ]);
        (&c::VALIDITY, signals)
    } else if pgn == c::HEALTH.pgn {
        let health = outputs.health.unwrap();
        let gate = match health.gate {
            Ok(()) => "block used".to_owned(),
            Err(kou_estimator::health::Closed::Sample(_)) => "sample not valid".to_owned(),
            Err(closed) => {
                let text = format!("{closed:?}");
                let words = text.chars().map(|ch| {
                    if ch.is_uppercase() { format!(" {}", ch.to_ascii_lowercase()) } else { ch.to_string() }
                });
                words.collect::<String>().trim().to_owned()
            }
        };
        let signals = meant([
            (&c::LEVEL, n(&c::LEVEL, Some(health.level.get()))),
            (&c::LEVEL_SE, n(&c::LEVEL_SE, Some(health.level_se.get()))),
            (&c::RATIO_OFFSET, n(&c::RATIO_OFFSET, Some(health.ratio_offset.get()))),
            (&c::WEAR_STAGE, json!(format!("{:?}", health.wear).to_lowercase())),
            (&c::SENSOR_STAGE, json!(format!("{:?}", health.sensor).to_lowercase())),
            (&c::GATE, json!(gate)),
        ]);
        (&c::HEALTH, signals)
    } else if pgn == c::STATUS.pgn {
        let health = outputs.health.unwrap();
        let causes = kou_estimator::health::Cause::ALL;
        let bits: u32 = (0..causes.len()).map(|i| u32::from(health.causes.contains(causes[i])) << i).sum();
        let signals = meant([
            (&c::CALIBRATION_CRC, json!(outputs.calibration.crc)),
            (&c::CALIBRATION_SOURCE, json!("stored")),
            (&c::CHANGES, json!(health.changes.min(255))),
            (&c::CAUSES, json!(bits)),
        ]);
        (&c::STATUS, signals)
    } else if pgn == c::DM1.pgn || pgn == c::DM2.pgn {
        let is_dm1 = pgn == c::DM1.pgn;
        let entries: Vec<&Entry> =
            outputs.faults.entries().iter().filter(|entry| entry.active == is_dm1).collect();
        assert!(entries.len() <= 1);
        let lamp = outputs.faults.active().next().is_some();
        (if is_dm1 { &c::DM1 } else { &c::DM2 }, trouble_of(entries.first().copied(), lamp))
    } else if pgn == c::ADDRESS_CLAIMED.pgn {
        let config = identity();
        let signals = json!({
            "IdentityNumber": config.identity, "ManufacturerCode": config.manufacturer,
            "EcuInstance": config.ecu_instance, "FunctionInstance": config.function_instance,
            "Function": config.function, "VehicleSystem": config.vehicle_system,
            "VehicleSystemInstance": config.vehicle_system_instance,
            "IndustryGroup": config.industry_group, "ArbitraryAddressCapable": 1,
        });
        (&c::ADDRESS_CLAIMED, signals.as_object().unwrap().clone())
    } else if pgn == c::ACKNOWLEDGEMENT.pgn {
        let signals = meant([
            (&c::ACK_CONTROL, json!("negative")),
            (&c::ACK_ADDRESS, json!(TOOL)),
            (&c::ACK_PGN, json!(65253)),
        ]);
        (&c::ACKNOWLEDGEMENT, signals)
    } else {
        // Packets of a list: the checker puts the list together again and compares it as a whole, see `lists`.
        let message = if pgn == c::TP_CM.pgn { &c::TP_CM } else { &c::TP_DT };
        assert_eq!(message.pgn, pgn);
        (message, Map::new())
    }
}

/// Twenty seconds on the bus, with everything that is ever sent.
fn capture() -> (Capture, Value) {
    let (calibration, params) = (reference_calibration(), reference_params());
    let health_params = HealthParams::new(&HealthConfig::for_law(&calibration.law), &params).unwrap();
    let (mut state, mut learned) = (State::new(), HealthState::new());
    let mut samples = Samples::new(11);
    let mut random = Random(5);
    let mut capture = Capture { log: String::new(), meant: Vec::new() };
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
        let health: Health = observe(&params, &health_params, &mut learned, &sample);
        // Troubles come one by one and go again: single frames first, lists later.
        match tick {
            400 => faults.confirmed(Code::Sensor(Channel::HighPressure, Fault::Open), Snapshot::at(4)),
            800 => faults.confirmed(Code::Wear, Snapshot::at(8)),
            1000 => faults.confirmed(Code::CalibrationLost, Snapshot::at(10)),
            1500 => faults.healed(Code::Wear),
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
            faults: &faults,
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
        // The drive's own messages, as readings that the firmware will take.
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
            // What the firmware took from the frame, not what was put into it.
            let taken = |signal: &Signal| {
                json!(f64::from(match signal.spn {
                    Some(161) => drive.pump_speed(now).value.unwrap().get(),
                    Some(191) => drive.motor_speed(now, false).value.unwrap().get(),
                    Some(1762) => 1000.0 * drive.high_pressure(now).value.unwrap().get(),
                    _ => drive.oil_temperature(now).value.unwrap().get(),
                }))
            };
            let signals = values.iter().map(|(signal, _)| (signal.name.to_owned(), taken(signal))).collect();
            capture.add(now, &frame, message, signals);
        }
    }
    capture_update(&mut capture, &node, ms(20_000));
    assert!(was_announced && lists.len() >= 5, "{}", lists.len());
    (capture, json!(lists))
}

/// A whole update and a refused command, with the answers.
fn capture_update(capture: &mut Capture, node: &Node, begin: Micros) {
    let key = key();
    let record = record_of(&reference_calibration());
    let transfer = Transfer::new(&record, 1, &key.0).unwrap();
    let mut session = Session::new();
    let guard = Guard { loaded: false, keys: &key, counter: 0, machine: None };
    let bytes = |first: (&str, &str), data: &[u8; 8]| {
        let mut signals = Map::new();
        signals.insert(first.0.to_owned(), json!(first.1));
        for (place, byte) in data.iter().enumerate().skip(1) {
            signals.insert(format!("Byte{place}"), json!(byte));
        }
        signals
    };
    let commands = transfer.commands().chain([Command::Abort, Command::Next { number: 0 }]);
    for (number, command) in commands.enumerate() {
        let now = Micros(begin.0 + 1000 * number as u64);
        let data = command.to_bytes();
        let command_name = match command {
            Command::Begin { .. } => "begin",
            Command::Data { .. } => "data",
            Command::Commit => "commit",
            Command::Abort => "abort",
            Command::Read { .. } => "read",
            Command::Next { .. } => "next",
        };
        let frame = Frame::new(Id::new(7, c::UPDATE_COMMAND.pgn, ADDRESS, TOOL), data);
        capture.add(now, &frame, &c::UPDATE_COMMAND, bytes(("Command", command_name), &data));
        let mut outcome = session.receive(now, TOOL, data, &guard);
        if outcome.todo.is_some() {
            outcome = session.stored(true);
        }
        let (tool, answer) = outcome.answer.unwrap();
        let answer_name = match answer {
            Answer::Begun => "begun",
            Answer::Taken { .. } => "taken",
            Answer::Committed { .. } => "committed",
            Answer::Aborted => "aborted",
            Answer::ToBeRead { .. } => "to be read",
            Answer::Segment { .. } => "segment",
            Answer::Refused { .. } => "refused",
        };
        let data = answer.to_bytes();
        let frame = node.update_answer(tool, data).unwrap();
        capture.add(now, &frame, &c::UPDATE_ANSWER, bytes(("Answer", answer_name), &data));
    }
}

fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Python with cantools, as the set-up installs it; nothing where there is none.
fn cantools() -> Option<PathBuf> {
    let python = workspace().join("target/cantools/bin/python");
    let works = Program::new(&python).args(["-c", "import cantools"]).output();
    works.is_ok_and(|output| output.status.success()).then_some(python)
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
    let output = Program::new(python).arg(script).args([&dbc, &log, &meant]).output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout);
    println!("{text}");
    assert!(output.status.success(), "{text}\n{}", String::from_utf8_lossy(&output.stderr));
    let count = capture.meant.len();
    assert!(text.contains(&format!("{count} frames agree")), "{text}");
    assert!(count > 5000);
}

#[test]
fn every_trouble_code_group_and_refusal_is_documented() {
    let read = |name: &str| std::fs::read_to_string(workspace().join("docs").join(name)).unwrap();
    let (can, update) = (read("can.md"), read("calibration-update.md"));
    for code in Code::all() {
        let Dtc { spn, fmi } = code.dtc();
        match code {
            Code::Sensor(channel, fault) => {
                assert!(can.contains(&format!("| {spn} |\n")), "{channel:?}");
                assert!(can.contains(&format!("| {} | {fmi} |", fault.name())), "{fault:?}");
            }
            Code::UpdateRefused(why) => {
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
