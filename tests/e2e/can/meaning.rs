//! Expected content of a frame, computed from the inputs of the firmware, not from the frame.

use kou_app::diagnostics::{Dtc, DtcReport};
use kou_app::j1939::catalogue as c;
use kou_app::j1939::signal::{Message, Signal};
use kou_app::j1939::{Frame, Outputs};
use kou_estimator::{Channel, Reason};
use serde_json::{Map, Value, json};

use super::{TOOL, identity};

/// Signals by their names.
pub fn meant<const N: usize>(signals: [(&Signal, Value); N]) -> Map<String, Value> {
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
        Some(Reason::SensorSuspected) => "sensor suspected".to_owned(),
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

fn trouble_of(entry: Option<&DtcReport>, lamp: bool) -> Map<String, Value> {
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

/// Expected content of a frame of the node, from its inputs.
pub fn meaning(
    frame: &Frame,
    outputs: &Outputs<'_>,
    counter: &mut u8,
) -> (&'static Message, Map<String, Value>) {
    let estimate = outputs.estimate;
    let (expected, seen) = (estimate.expected.ok(), estimate.observed.ok());
    let n = number;
    let pgn = frame.id().pgn();
    if pgn == c::LEAKAGE.pgn {
        let signals = meant([
            (&c::KOU_EXPECTED, n(&c::KOU_EXPECTED, expected.map(|e| e.kou.get()))),
            (&c::KOU_SEEN, n(&c::KOU_SEEN, seen.map(|s| s.kou.get()))),
        ]);
        (&c::LEAKAGE, signals)
    } else if pgn == c::LEAKAGE_SE.pgn {
        let signals = meant([
            (&c::KOU_EXPECTED_SE, n(&c::KOU_EXPECTED_SE, expected.map(|e| e.kou_se.get()))),
            (&c::KOU_SEEN_SE, n(&c::KOU_SEEN_SE, seen.map(|s| s.kou_se.get()))),
        ]);
        (&c::LEAKAGE_SE, signals)
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
        let (seen_channel, seen_fault) = sensor_of(estimate.observed.err());
        let wear = estimate.wear_ratio().ok().map(|ratio| ratio.get());
        let signals = meant([
            (&c::EXPECTED_REASON, reason_name(estimate.expected.err())),
            (&c::EXPECTED_CHANNEL, expected_channel),
            (&c::EXPECTED_FAULT, expected_fault),
            (&c::SEEN_REASON, reason_name(estimate.observed.err())),
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
            Err(kou_estimator::health::GateClosed::Sample(_)) => "sample not valid".to_owned(),
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
        let entries: Vec<&DtcReport> =
            outputs.dtcs.all().iter().filter(|entry| entry.active == is_dm1).collect();
        assert!(entries.len() <= 1);
        let lamp = outputs.dtcs.has_active();
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
