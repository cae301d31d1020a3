//! Every message that the controller sends or understands, described once: encode, decode and the DBC file
//! (`kou.dbc`) are all made from these tables. `docs/can.md` explains them.
//!
//! Groups and parameters of the standard are those of SAE J1939-71 (shafts, pressure, temperature), -73 (diagnostics),
//! -21 (transport, request) and -81 (address claim). The controller's own groups are proprietary B (0xFF40 to 0xFF44), and
//! proprietary A for the calibration update.

use super::Pgn;
use super::signal::{Coding, Message, Sender, Signal};

const fn plain(name: &'static str, start: u8, length: u8, comment: &'static str) -> Signal {
    Signal {
        name,
        spn: None,
        start,
        length,
        coding: Coding::Plain,
        scale: 1.0,
        offset: 0.0,
        unit: "",
        values: &[],
        comment,
    }
}

const fn state(
    name: &'static str,
    start: u8,
    length: u8,
    values: &'static [(u32, &'static str)],
    comment: &'static str,
) -> Signal {
    Signal { coding: Coding::State, values, ..plain(name, start, length, comment) }
}

/// A measured quantity of 16 bits at byte `byte`, counted from 0.
const fn word(
    name: &'static str,
    byte: u8,
    scale: f32,
    offset: f32,
    unit: &'static str,
    comment: &'static str,
) -> Signal {
    Signal { coding: Coding::Measured, scale, offset, unit, ..plain(name, 8 * byte, 16, comment) }
}

const fn with_spn(signal: Signal, spn: u32) -> Signal {
    Signal { spn: Some(spn), ..signal }
}

// ---- Received: the drive's own messages as an alternative to own sensors.

/// Motor (output) shaft speed, magnitude.
pub const OUTPUT_SHAFT_SPEED: Signal = with_spn(
    word("TransOutputShaftSpeed", 1, 0.125, 0.0, "r/min", "Speed of the motor's shaft, magnitude"),
    191,
);
/// Pump (input) shaft speed.
pub const INPUT_SHAFT_SPEED: Signal =
    with_spn(word("TransInputShaftSpeed", 5, 0.125, 0.0, "r/min", "Speed of the pump's shaft"), 161);
/// Electronic transmission controller 1.
pub const ETC1: Message = Message {
    name: "ETC1",
    pgn: Pgn::new(61442),
    priority: 3,
    length: 8,
    period_ms: 10,
    sender: Sender::Drive,
    signals: &[OUTPUT_SHAFT_SPEED, INPUT_SHAFT_SPEED],
    comment: "Electronic Transmission Controller 1: shaft speeds",
};

/// Pressure of the high line.
pub const HYDRAULIC_PRESSURE: Signal =
    with_spn(word("HydraulicPressure", 0, 2.0, 0.0, "kPa", "Pressure of the high line, gauge"), 1762);
/// Hydraulic pressure governor information.
pub const HPG: Message = Message {
    name: "HPG",
    pgn: Pgn::new(61448),
    priority: 3,
    length: 8,
    period_ms: 50,
    sender: Sender::Drive,
    signals: &[HYDRAULIC_PRESSURE],
    comment: "Hydraulic Pressure Governor Information: pressure of the high line",
};

/// Oil temperature.
pub const OIL_TEMPERATURE: Signal =
    with_spn(word("TransOilTemperature", 4, 0.03125, -273.0, "degC", "Oil temperature"), 177);
/// Transmission fluids 1.
pub const TRF1: Message = Message {
    name: "TRF1",
    pgn: Pgn::new(65272),
    priority: 6,
    length: 8,
    period_ms: 1000,
    sender: Sender::Drive,
    signals: &[OIL_TEMPERATURE],
    comment: "Transmission Fluids 1: oil temperature",
};

// ---- Sent: estimates.

/// Leakage coefficient by the law.
pub const KOU_EXPECTED: Signal = word(
    "KouExpected",
    0,
    2e-5,
    0.0,
    "L/min/MPa",
    "Leakage coefficient of one chamber by the calibrated law",
);
/// Its standard error.
pub const KOU_EXPECTED_SE: Signal =
    word("KouExpectedSe", 2, 2e-5, 0.0, "L/min/MPa", "Standard error (1 sigma) of KouExpected");
/// Leakage coefficient by the measured ratio.
pub const KOU_SEEN: Signal = word(
    "KouSeen",
    4,
    2e-5,
    0.0,
    "L/min/MPa",
    "Leakage coefficient of one chamber that explains the measured speed ratio",
);
/// Its standard error.
pub const KOU_SEEN_SE: Signal =
    word("KouSeenSe", 6, 2e-5, 0.0, "L/min/MPa", "Standard error (1 sigma) of KouSeen");
/// Leakage coefficients.
pub const LEAKAGE: Message = Message {
    name: "KouLeakage",
    pgn: Pgn::new(0xFF40),
    priority: 6,
    length: 8,
    period_ms: 100,
    sender: Sender::Kou,
    signals: &[KOU_EXPECTED, KOU_EXPECTED_SE, KOU_SEEN, KOU_SEEN_SE],
    comment: "Leakage coefficients; where not available, KouValidity says why",
};

/// Volumetric efficiency by law and reduced model.
pub const EFFICIENCY_EXPECTED: Signal = word(
    "VolumetricEfficiencyExpected",
    0,
    0.0025,
    0.0,
    "%",
    "Volumetric efficiency by law and reduced model",
);
/// Volumetric efficiency as measured.
pub const EFFICIENCY_SEEN: Signal =
    word("VolumetricEfficiencySeen", 2, 0.0025, 0.0, "%", "Volumetric efficiency as measured");
/// Leakage flow by the law.
pub const FLOW_EXPECTED: Signal = word(
    "LeakageFlowExpected",
    4,
    0.01,
    0.0,
    "L/min",
    "Leakage flow of all chambers to the case, at high pressure, by the law",
);
/// Leakage flow seen.
pub const FLOW_SEEN: Signal = word(
    "LeakageFlowSeen",
    6,
    0.01,
    0.0,
    "L/min",
    "Leakage flow of all chambers to the case, at high pressure, by the measured ratio",
);
/// Volumetric efficiency and leakage flow.
pub const EFFICIENCY: Message = Message {
    name: "KouEfficiency",
    pgn: Pgn::new(0xFF41),
    priority: 6,
    length: 8,
    period_ms: 100,
    sender: Sender::Kou,
    signals: &[EFFICIENCY_EXPECTED, EFFICIENCY_SEEN, FLOW_EXPECTED, FLOW_SEEN],
    comment: "Volumetric efficiency and leakage flow, expected and seen",
};

/// Names of the reasons. Zero is valid; [`super::publish::reason_code`] gives the numbers.
pub const REASONS: &[(u32, &str)] = &[
    (0, "valid"),
    (1, "sensor"),
    (2, "time reversed"),
    (3, "speed too low"),
    (4, "displacement too small"),
    (5, "not loaded"),
    (6, "law not positive"),
    (7, "leakage takes flow"),
    (8, "ratio not positive"),
    (9, "ratio above leak free"),
    (10, "Kou implausible"),
    (16, "outside region: speed"),
    (17, "outside region: pressure"),
    (18, "outside region: temperature"),
    (19, "outside region: speed + pressure"),
    (20, "outside region: speed - pressure"),
    (21, "outside region: speed + temperature"),
    (22, "outside region: speed - temperature"),
    (23, "outside region: pressure + temperature"),
    (24, "outside region: pressure - temperature"),
];
/// Names of the channels.
pub const CHANNELS: &[(u32, &str)] = &[
    (0, "pump speed"),
    (1, "high pressure"),
    (2, "low pressure"),
    (3, "oil temperature"),
    (4, "displacement"),
    (5, "motor speed"),
    (6, "flow"),
];
/// Names of the faults of a channel.
pub const FAULTS: &[(u32, &str)] = &[
    (0, "not fitted"),
    (1, "missing"),
    (2, "open"),
    (3, "short"),
    (4, "stale"),
    (5, "future"),
    (6, "out of range"),
    (7, "not finite"),
    (8, "stuck"),
    (9, "rate"),
];
/// Why nothing is expected.
pub const EXPECTED_REASON: Signal =
    state("ExpectedReason", 0, 8, REASONS, "Why nothing is expected; 0 when valid");
/// Which sensor, of the reason "sensor".
pub const EXPECTED_CHANNEL: Signal =
    state("ExpectedChannel", 8, 4, CHANNELS, "Channel of ExpectedReason when that is a sensor");
/// What is wrong with it.
pub const EXPECTED_FAULT: Signal =
    state("ExpectedFault", 12, 4, FAULTS, "Fault of ExpectedChannel when the reason is a sensor");
/// Why nothing is seen.
pub const SEEN_REASON: Signal = state("SeenReason", 16, 8, REASONS, "Why nothing is seen; 0 when valid");
/// Which sensor, of the reason "sensor".
pub const SEEN_CHANNEL: Signal =
    state("SeenChannel", 24, 4, CHANNELS, "Channel of SeenReason when that is a sensor");
/// What is wrong with it.
pub const SEEN_FAULT: Signal =
    state("SeenFault", 28, 4, FAULTS, "Fault of SeenChannel when the reason is a sensor");
/// Wear ratio.
pub const WEAR_RATIO: Signal =
    word("WearRatio", 4, 0.0005, 0.0, "", "KouSeen over KouExpected: 1 as calibrated, rising with wear");
/// Counter of estimates.
pub const ESTIMATE_COUNTER: Signal =
    plain("EstimateCounter", 48, 8, "Counts the messages and wraps: shows a frozen sender");
/// Validity of the estimates.
pub const VALIDITY: Message = Message {
    name: "KouValidity",
    pgn: Pgn::new(0xFF42),
    priority: 6,
    length: 8,
    period_ms: 100,
    sender: Sender::Kou,
    signals: &[
        EXPECTED_REASON,
        EXPECTED_CHANNEL,
        EXPECTED_FAULT,
        SEEN_REASON,
        SEEN_CHANNEL,
        SEEN_FAULT,
        WEAR_RATIO,
        ESTIMATE_COUNTER,
    ],
    comment: "Whether the estimates are valid, and why not",
};

/// Names of the stages of a trouble.
pub const STAGES: &[(u32, &str)] = &[(0, "absent"), (1, "pending"), (2, "confirmed"), (3, "healed")];
/// Names of what the gate of learning says.
pub const GATES: &[(u32, &str)] = &[
    (0, "block used"),
    (1, "sample not valid"),
    (2, "filling"),
    (3, "after gap"),
    (4, "speed unsteady"),
    (5, "pressure unsteady"),
    (6, "displacement unsteady"),
    (7, "ratio unsteady"),
];
/// Learned level.
pub const LEVEL: Signal =
    word("Level", 0, 0.0005, 0.0, "", "Learned leakage over the law's: 1 as calibrated");
/// Its standard error.
pub const LEVEL_SE: Signal = word("LevelSe", 2, 0.0001, 0.0, "", "Standard error (1 sigma) of Level");
/// Factor on the ratio that is not leakage.
pub const RATIO_OFFSET: Signal =
    word("RatioOffset", 4, 0.0001, -3.2, "", "Factor on the ratio that is not leakage, less 1");
/// Trouble: wear.
pub const WEAR_STAGE: Signal = state("WearStage", 48, 4, STAGES, "Trouble: leaks more than it did");
/// Trouble: a sensor or the oil.
pub const SENSOR_STAGE: Signal =
    state("SensorStage", 52, 4, STAGES, "Trouble: a sensor, the displacement or the oil explains a change");
/// What the gate of learning says.
pub const GATE: Signal =
    state("Gate", 56, 8, GATES, "Whether the present block was learned from, or why not");
/// Learned health.
pub const HEALTH: Message = Message {
    name: "KouHealth",
    pgn: Pgn::new(0xFF43),
    priority: 6,
    length: 8,
    period_ms: 1000,
    sender: Sender::Kou,
    signals: &[LEVEL, LEVEL_SE, RATIO_OFFSET, WEAR_STAGE, SENSOR_STAGE, GATE],
    comment: "What has been learned of the machine while driving",
};

/// Names of where the calibration comes from.
pub const SOURCES: &[(u32, &str)] = &[(0, "none"), (1, "default"), (2, "stored")];
/// CRC-32 of the calibration record in use.
pub const CALIBRATION_CRC: Signal = plain("CalibrationCrc", 0, 32, "CRC-32 of the calibration record in use");
/// Where it comes from.
pub const CALIBRATION_SOURCE: Signal =
    state("CalibrationSource", 32, 4, SOURCES, "Where the calibration in use comes from");
/// Changes found.
pub const CHANGES: Signal =
    plain("Changes", 40, 8, "Changes of the leakage found since health was reset; stays at 255");
/// Causes that remain.
pub const CAUSES: Signal = plain(
    "Causes",
    48,
    16,
    "Causes that remain for the last change, one bit each in the order of docs/health.md, lowest first",
);
/// State of the controller.
pub const STATUS: Message = Message {
    name: "KouStatus",
    pgn: Pgn::new(0xFF44),
    priority: 6,
    length: 8,
    period_ms: 1000,
    sender: Sender::Kou,
    signals: &[CALIBRATION_CRC, CALIBRATION_SOURCE, CHANGES, CAUSES],
    comment: "Calibration in use, and what the last change may have been",
};

// ---- Diagnostics.

const LAMP: &[(u32, &str)] = &[(0, "off"), (1, "on")];
const FLASH: &[(u32, &str)] = &[(0, "slow"), (1, "fast")];
/// Lamp for protection of the machine.
pub const PROTECT_LAMP: Signal = with_spn(state("ProtectLamp", 0, 2, LAMP, "Protect lamp"), 987);
/// Lamp for a warning.
pub const AMBER_LAMP: Signal = with_spn(state("AmberWarningLamp", 2, 2, LAMP, "Amber warning lamp"), 624);
/// Lamp for stopping.
pub const RED_LAMP: Signal = with_spn(state("RedStopLamp", 4, 2, LAMP, "Red stop lamp"), 623);
/// Malfunction lamp, for emissions.
pub const MALFUNCTION_LAMP: Signal =
    with_spn(state("MalfunctionLamp", 6, 2, LAMP, "Malfunction indicator lamp"), 1213);
/// Low 16 bits of the trouble's SPN.
pub const DTC_SPN_LOW: Signal = plain("DtcSpnLow", 16, 16, "Low 16 bits of the trouble's SPN; 0: no trouble");
/// Failure mode.
pub const DTC_FMI: Signal = plain("DtcFmi", 32, 5, "Failure mode identifier");
/// High 3 bits of the trouble's SPN.
pub const DTC_SPN_HIGH: Signal = plain("DtcSpnHigh", 37, 3, "High 3 bits of the trouble's SPN");
/// How often it occurred.
pub const DTC_COUNT: Signal = plain("DtcOccurrences", 40, 7, "Number of occurrences; 127: not known");
/// How the SPN is written.
pub const DTC_METHOD: Signal =
    plain("DtcConversionMethod", 47, 1, "SPN conversion method: 0, as laid out here");
const TROUBLE_SIGNALS: &[Signal] = &[
    PROTECT_LAMP,
    AMBER_LAMP,
    RED_LAMP,
    MALFUNCTION_LAMP,
    state("FlashProtectLamp", 8, 2, FLASH, "Flashing of the protect lamp"),
    state("FlashAmberWarningLamp", 10, 2, FLASH, "Flashing of the amber warning lamp"),
    state("FlashRedStopLamp", 12, 2, FLASH, "Flashing of the red stop lamp"),
    state("FlashMalfunctionLamp", 14, 2, FLASH, "Flashing of the malfunction indicator lamp"),
    DTC_SPN_LOW,
    DTC_FMI,
    DTC_SPN_HIGH,
    DTC_COUNT,
    DTC_METHOD,
];
/// Active troubles. With more than one, the list goes by transport protocol instead.
pub const DM1: Message = Message {
    name: "DM1",
    pgn: Pgn::new(65226),
    priority: 6,
    length: 8,
    period_ms: 1000,
    sender: Sender::Kou,
    signals: TROUBLE_SIGNALS,
    comment: "Active troubles: at most one; with more, the list goes by transport protocol",
};
/// Previously active troubles, likewise.
pub const DM2: Message = Message {
    name: "DM2",
    pgn: Pgn::new(65227),
    period_ms: 0,
    comment: "Previously active troubles, on request; with more than one by transport protocol",
    ..DM1
};

// ---- Network.

/// Group asked for, of a request.
pub const REQUESTED_PGN: Signal = plain("RequestedPgn", 0, 24, "Parameter group that is asked for");
/// Request for a group.
pub const REQUEST: Message = Message {
    name: "Request",
    pgn: Pgn::new(59904),
    priority: 6,
    length: 3,
    period_ms: 0,
    sender: Sender::Tool,
    signals: &[REQUESTED_PGN],
    comment: "Request for a parameter group: DM1, DM2, AddressClaimed",
};
/// Kind of an acknowledgement.
pub const ACK_CONTROL: Signal = Signal {
    values: &[(0, "positive"), (1, "negative"), (2, "access denied"), (3, "cannot respond")],
    ..plain("AckControl", 0, 8, "Kind of acknowledgement")
};
/// Address that asked.
pub const ACK_ADDRESS: Signal = plain("AckAddress", 32, 8, "Address that asked");
/// Group that was asked for.
pub const ACK_PGN: Signal = plain("AckPgn", 40, 24, "Parameter group that was asked for");
/// Acknowledgement.
pub const ACKNOWLEDGEMENT: Message = Message {
    name: "Acknowledgement",
    pgn: Pgn::new(59392),
    priority: 6,
    length: 8,
    period_ms: 0,
    sender: Sender::Kou,
    signals: &[ACK_CONTROL, ACK_ADDRESS, ACK_PGN],
    comment: "Answer to a request for a group that this controller does not send",
};
/// Address claim, or "cannot claim" from the null address.
pub const ADDRESS_CLAIMED: Message = Message {
    name: "AddressClaimed",
    pgn: Pgn::new(60928),
    priority: 6,
    length: 8,
    period_ms: 0,
    sender: Sender::Kou,
    signals: &[
        with_spn(plain("IdentityNumber", 0, 21, "Serial number of the controller"), 2837),
        with_spn(plain("ManufacturerCode", 21, 11, "Manufacturer"), 2838),
        with_spn(plain("EcuInstance", 32, 3, "Which of several controllers of a function"), 2840),
        with_spn(plain("FunctionInstance", 35, 5, "Which of several functions"), 2839),
        with_spn(plain("Function", 40, 8, "Function"), 2841),
        with_spn(plain("VehicleSystem", 49, 7, "Vehicle system"), 2842),
        with_spn(plain("VehicleSystemInstance", 56, 4, "Which of several vehicle systems"), 2843),
        with_spn(plain("IndustryGroup", 60, 3, "Industry group"), 2846),
        with_spn(plain("ArbitraryAddressCapable", 63, 1, "Can take another address"), 2844),
    ],
    comment: "Name of the controller that uses the source address",
};
/// Control byte of the transport protocol's connection management.
pub const TP_CONTROL: Signal =
    Signal { values: &[(32, "BAM")], ..plain("TpControl", 0, 8, "32: announcement of a message to all") };
/// Length of the announced message.
pub const TP_SIZE: Signal = plain("TpSize", 8, 16, "Bytes of the announced message");
/// Packets of the announced message.
pub const TP_PACKETS: Signal = plain("TpPackets", 24, 8, "Packets of the announced message");
/// Group of the announced message.
pub const TP_PGN: Signal = plain("TpPgn", 40, 24, "Parameter group of the announced message");
/// Transport protocol, connection management.
pub const TP_CM: Message = Message {
    name: "TpConnectionManagement",
    pgn: Pgn::new(60416),
    priority: 7,
    length: 8,
    period_ms: 0,
    sender: Sender::Kou,
    signals: &[TP_CONTROL, TP_SIZE, TP_PACKETS, TP_PGN],
    comment: "Announces a message of more than eight bytes",
};
/// Number of the packet.
pub const TP_SEQUENCE: Signal = plain("TpSequence", 0, 8, "Number of the packet, from 1");
/// Transport protocol, data.
pub const TP_DT: Message = Message {
    name: "TpDataTransfer",
    pgn: Pgn::new(60160),
    priority: 7,
    length: 8,
    period_ms: 0,
    sender: Sender::Kou,
    signals: &[
        TP_SEQUENCE,
        plain("TpByte1", 8, 8, "First byte of the packet"),
        plain("TpByte2", 16, 8, "Second byte"),
        plain("TpByte3", 24, 8, "Third byte"),
        plain("TpByte4", 32, 8, "Fourth byte"),
        plain("TpByte5", 40, 8, "Fifth byte"),
        plain("TpByte6", 48, 8, "Sixth byte"),
        plain("TpByte7", 56, 8, "Seventh byte"),
    ],
    comment: "Seven bytes of an announced message, filled up with 255",
};

const UPDATE_BYTES: [Signal; 7] = [
    plain("Byte1", 8, 8, "Second byte: docs/calibration-update.md"),
    plain("Byte2", 16, 8, "Third byte"),
    plain("Byte3", 24, 8, "Fourth byte"),
    plain("Byte4", 32, 8, "Fifth byte"),
    plain("Byte5", 40, 8, "Sixth byte"),
    plain("Byte6", 48, 8, "Seventh byte"),
    plain("Byte7", 56, 8, "Eighth byte"),
];
const UPDATE_COMMANDS: &[(u32, &str)] =
    &[(1, "begin"), (2, "data"), (3, "commit"), (4, "abort"), (17, "read"), (18, "next")];
const UPDATE_ANSWERS: &[(u32, &str)] = &[
    (0x7F, "refused"),
    (0x81, "begun"),
    (0x82, "taken"),
    (0x83, "committed"),
    (0x84, "aborted"),
    (0x91, "to be read"),
    (0x92, "segment"),
];
const fn update_signals(first: Signal) -> [Signal; 8] {
    let [b1, b2, b3, b4, b5, b6, b7] = UPDATE_BYTES;
    [first, b1, b2, b3, b4, b5, b6, b7]
}
/// A tool's command in a calibration update. Proprietary A.
pub const UPDATE_COMMAND: Message = Message {
    name: "KouUpdateCommand",
    pgn: Pgn::new(61184),
    priority: 7,
    length: 8,
    period_ms: 0,
    sender: Sender::Tool,
    signals: &update_signals(Signal {
        values: UPDATE_COMMANDS,
        ..plain("Command", 0, 8, "What the tool wants")
    }),
    comment: "Step of a calibration update or reading, to the controller",
};
/// The controller's answer in a calibration update. Proprietary A.
pub const UPDATE_ANSWER: Message = Message {
    name: "KouUpdateAnswer",
    sender: Sender::Kou,
    signals: &update_signals(Signal { values: UPDATE_ANSWERS, ..plain("Answer", 0, 8, "What became of it") }),
    comment: "Answer to a step of a calibration update or reading, to the tool",
    ..UPDATE_COMMAND
};

/// Every message.
pub const ALL: &[Message] = &[
    ETC1,
    HPG,
    TRF1,
    LEAKAGE,
    EFFICIENCY,
    VALIDITY,
    HEALTH,
    STATUS,
    DM1,
    DM2,
    REQUEST,
    ACKNOWLEDGEMENT,
    ADDRESS_CLAIMED,
    TP_CM,
    TP_DT,
    UPDATE_COMMAND,
    UPDATE_ANSWER,
];

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use kou_estimator::{Channel, Fault};

    use super::*;

    #[test]
    fn signals_lie_within_their_messages_and_apart_and_have_names_of_their_own() {
        let mut names = HashSet::new();
        for message in ALL {
            assert!(names.insert(message.name), "{}", message.name);
            let mut taken = 0_u64;
            let mut signals = HashSet::new();
            for signal in message.signals {
                assert!(signals.insert(signal.name), "{}", signal.name);
                assert!((1..=32).contains(&signal.length));
                assert!(signal.start + signal.length <= 8 * message.length, "{}", signal.name);
                let mask = (u64::from(signal.all_ones())) << signal.start;
                assert_eq!(taken & mask, 0, "{} overlaps", signal.name);
                taken |= mask;
                assert!(signal.values.iter().all(|(raw, _)| *raw <= signal.raw_max()), "{}", signal.name);
                assert!(
                    signal.coding != Coding::Measured
                        || matches!((signal.start % 8, signal.length), (0, 8 | 16 | 32)),
                    "{}",
                    signal.name
                );
            }
        }
    }

    #[test]
    fn names_of_channels_and_faults_follow_the_estimator() {
        let same = |text: &str, name: &str| text.replace(' ', "_") == name;
        for ((number, text), fault) in FAULTS.iter().zip(Fault::ALL) {
            assert!(same(text, fault.name()), "{number}");
        }
        assert_eq!((FAULTS.len(), CHANNELS.len()), (Fault::ALL.len(), Channel::ALL.len()));
    }
}
