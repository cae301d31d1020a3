//! Sent: diagnostic messages (SAE J1939-73).

use super::builders::{plain, state, with_spn};
use crate::j1939::id::Pgn;
use crate::j1939::signal::{Message, Sender, Signal};

const LAMP: &[(u32, &str)] = &[(0, "off"), (1, "on")];
const FLASH: &[(u32, &str)] = &[(0, "slow"), (1, "fast")];
/// Protect lamp.
pub const PROTECT_LAMP: Signal = with_spn(state("ProtectLamp", 0, 2, LAMP, "Protect lamp"), 987);
/// Amber warning lamp.
pub const AMBER_LAMP: Signal = with_spn(state("AmberWarningLamp", 2, 2, LAMP, "Amber warning lamp"), 624);
/// Red stop lamp.
pub const RED_LAMP: Signal = with_spn(state("RedStopLamp", 4, 2, LAMP, "Red stop lamp"), 623);
/// Malfunction indicator lamp, for emissions.
pub const MALFUNCTION_LAMP: Signal =
    with_spn(state("MalfunctionLamp", 6, 2, LAMP, "Malfunction indicator lamp"), 1213);
/// Low 16 bits of the trouble code's SPN.
pub const DTC_SPN_LOW: Signal = plain("DtcSpnLow", 16, 16, "Low 16 bits of the SPN; 0: no trouble code");
/// Failure mode identifier.
pub const DTC_FMI: Signal = plain("DtcFmi", 32, 5, "Failure mode identifier");
/// High 3 bits of the trouble code's SPN.
pub const DTC_SPN_HIGH: Signal = plain("DtcSpnHigh", 37, 3, "High 3 bits of the SPN");
/// Occurrence count.
pub const DTC_COUNT: Signal = plain("DtcOccurrences", 40, 7, "Number of occurrences; 127: not known");
/// SPN conversion method.
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
/// Active trouble codes. A list of more than one is sent by transport protocol.
pub const DM1: Message = Message {
    name: "DM1",
    pgn: Pgn::new(65226),
    priority: 6,
    length: 8,
    period_ms: 1000,
    sender: Sender::Kou,
    signals: TROUBLE_SIGNALS,
    comment: "Active trouble codes: at most one; more are sent by transport protocol",
}
.carried();
/// Previously active trouble codes, sent likewise.
pub const DM2: Message = Message {
    name: "DM2",
    pgn: Pgn::new(65227),
    period_ms: 0,
    comment: "Previously active trouble codes, on request; more than one by transport protocol",
    ..DM1
}
.carried();
