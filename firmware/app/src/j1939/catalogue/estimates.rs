//! Sent: estimates, their validity, learned health and the state of the controller (proprietary B).

use super::builders::{plain, state, word};
use crate::j1939::id::Pgn;
use crate::j1939::signal::{Message, Sender, Signal};

/// Leakage coefficient; the largest that a calibration allows, 100, is a fortieth of the signal's range.
const fn kou(name: &'static str, byte: u8, comment: &'static str) -> Signal {
    Signal { length: 32, ..word(name, byte, 1e-6, 0.0, "L/min/MPa", comment) }
}

/// Leakage coefficient expected by the law.
pub const KOU_EXPECTED: Signal =
    kou("KouExpected", 0, "Leakage coefficient of one chamber by the calibrated law");
/// Leakage coefficient observed, from the measured speed ratio.
pub const KOU_SEEN: Signal =
    kou("KouSeen", 4, "Leakage coefficient of one chamber that explains the measured speed ratio");
/// Leakage coefficients.
pub const LEAKAGE: Message = Message {
    name: "KouLeakage",
    pgn: Pgn::new(0xFF40),
    priority: 6,
    length: 8,
    period_ms: 100,
    sender: Sender::Kou,
    signals: &[KOU_EXPECTED, KOU_SEEN],
    comment: "Leakage coefficients; where not available, KouValidity says why",
}
.carried();

/// Standard error of [`KOU_EXPECTED`].
pub const KOU_EXPECTED_SE: Signal = kou("KouExpectedSe", 0, "Standard error (1 sigma) of KouExpected");
/// Standard error of [`KOU_SEEN`].
pub const KOU_SEEN_SE: Signal = kou("KouSeenSe", 4, "Standard error (1 sigma) of KouSeen");
/// Standard errors of the leakage coefficients.
pub const LEAKAGE_SE: Message = Message {
    name: "KouLeakageSe",
    pgn: Pgn::new(0xFF45),
    priority: 6,
    length: 8,
    period_ms: 100,
    sender: Sender::Kou,
    signals: &[KOU_EXPECTED_SE, KOU_SEEN_SE],
    comment: "Standard errors of KouLeakage, wider while it is open whether machine or sensor has changed",
};

/// Volumetric efficiency expected by law and flow balance.
pub const EFFICIENCY_EXPECTED: Signal = word(
    "VolumetricEfficiencyExpected",
    0,
    0.0025,
    0.0,
    "%",
    "Volumetric efficiency by law and reduced model",
);
/// Volumetric efficiency observed.
pub const EFFICIENCY_SEEN: Signal =
    word("VolumetricEfficiencySeen", 2, 0.0025, 0.0, "%", "Volumetric efficiency as measured");
/// Leakage flow expected by the law.
pub const FLOW_EXPECTED: Signal = word(
    "LeakageFlowExpected",
    4,
    0.01,
    0.0,
    "L/min",
    "Leakage flow of all chambers to the case, at high pressure, by the law",
);
/// Leakage flow observed.
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
}
.carried();

/// Names of the reasons. Zero is valid; [`crate::j1939::publish::reason_code`] returns the numbers.
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
    (11, "sensor suspected"),
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
    (10, "implausible"),
];
/// Reason why the expected part is invalid.
pub const EXPECTED_REASON: Signal =
    state("ExpectedReason", 0, 8, REASONS, "Why nothing is expected; 0 when valid");
/// Channel of the reason "sensor".
pub const EXPECTED_CHANNEL: Signal =
    state("ExpectedChannel", 8, 4, CHANNELS, "Channel of ExpectedReason when that is a sensor");
/// Fault of that channel.
pub const EXPECTED_FAULT: Signal =
    state("ExpectedFault", 12, 4, FAULTS, "Fault of ExpectedChannel when the reason is a sensor");
/// Reason why the observed part is invalid.
pub const SEEN_REASON: Signal = state("SeenReason", 16, 8, REASONS, "Why nothing is seen; 0 when valid");
/// Channel of the reason "sensor".
pub const SEEN_CHANNEL: Signal =
    state("SeenChannel", 24, 4, CHANNELS, "Channel of SeenReason when that is a sensor");
/// Fault of that channel.
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
}
.carried();

/// Names of a fault's status.
pub const STAGES: &[(u32, &str)] = &[(0, "absent"), (1, "pending"), (2, "confirmed"), (3, "healed")];
/// Names of the learning gate's states.
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
/// Learned leakage level.
pub const LEVEL: Signal =
    word("Level", 0, 0.0005, 0.0, "", "Learned leakage over the law's: 1 as calibrated");
/// Standard error of the level.
pub const LEVEL_SE: Signal = word("LevelSe", 2, 0.0001, 0.0, "", "Standard error (1 sigma) of Level");
/// Learned correction of the speed ratio that is not leakage.
pub const RATIO_OFFSET: Signal =
    word("RatioOffset", 4, 0.0001, -3.2, "", "Factor on the ratio that is not leakage, less 1");
/// Fault status: wear.
pub const WEAR_STAGE: Signal = state("WearStage", 48, 4, STAGES, "Fault status: increased leakage by wear");
/// Fault status: sensor, displacement or oil.
pub const SENSOR_STAGE: Signal = state(
    "SensorStage",
    52,
    4,
    STAGES,
    "Fault status: a change explained by a sensor, the displacement or the oil",
);
/// State of the learning gate.
pub const GATE: Signal =
    state("Gate", 56, 8, GATES, "State of the learning gate: open, or the reason why it is closed");
/// Learned health.
pub const HEALTH: Message = Message {
    name: "KouHealth",
    pgn: Pgn::new(0xFF43),
    priority: 6,
    length: 8,
    period_ms: 1000,
    sender: Sender::Kou,
    signals: &[LEVEL, LEVEL_SE, RATIO_OFFSET, WEAR_STAGE, SENSOR_STAGE, GATE],
    comment: "Learned health of the machine",
}
.carried();

/// Names of the calibration's sources.
pub const SOURCES: &[(u32, &str)] = &[(0, "none"), (1, "default"), (2, "stored")];
/// CRC-32 of the calibration record in use.
pub const CALIBRATION_CRC: Signal = plain("CalibrationCrc", 0, 32, "CRC-32 of the calibration record in use");
/// Source of the calibration in use.
pub const CALIBRATION_SOURCE: Signal =
    state("CalibrationSource", 32, 4, SOURCES, "Source of the calibration in use");
/// Number of detected changes.
pub const CHANGES: Signal =
    plain("Changes", 40, 8, "Changes of the leakage found since health was reset; stays at 255");
/// Remaining causes of the last change.
pub const CAUSES: Signal = plain(
    "Causes",
    48,
    16,
    "Causes that remain for the last change, one bit each in the order of docs/health/theory.md, lowest first",
);
/// Status of the controller.
pub const STATUS: Message = Message {
    name: "KouStatus",
    pgn: Pgn::new(0xFF44),
    priority: 6,
    length: 8,
    period_ms: 1000,
    sender: Sender::Kou,
    signals: &[CALIBRATION_CRC, CALIBRATION_SOURCE, CHANGES, CAUSES],
    comment: "Calibration in use, and possible causes of the last change",
}
.carried();
