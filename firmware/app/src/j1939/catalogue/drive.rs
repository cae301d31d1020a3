//! Received: messages of the drive's other controllers as an alternative to own sensors (SAE J1939-71).

use super::builders::{with_spn, word};
use crate::j1939::id::Pgn;
use crate::j1939::signal::{Message, Sender, Signal};

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
}
.carried();

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
}
.carried();

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
}
.carried();
