//! Calibration update (proprietary A). `docs/calibration-update.md` explains the bytes.

use super::builders::plain;
use crate::j1939::id::Pgn;
use crate::j1939::signal::{Message, Sender, Signal};

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
/// Command of a tool in a calibration update, proprietary A.
pub const UPDATE_COMMAND: Message = Message {
    name: "KouUpdateCommand",
    pgn: Pgn::new(61184),
    priority: 7,
    length: 8,
    period_ms: 0,
    sender: Sender::Tool,
    signals: &update_signals(Signal {
        values: UPDATE_COMMANDS,
        ..plain("Command", 0, 8, "Command of the tool")
    }),
    comment: "Step of a calibration update or reading, to the controller",
}
.carried();
/// Answer of the controller in a calibration update, proprietary A.
pub const UPDATE_ANSWER: Message = Message {
    name: "KouUpdateAnswer",
    sender: Sender::Kou,
    signals: &update_signals(Signal {
        values: UPDATE_ANSWERS,
        ..plain("Answer", 0, 8, "Answer of the controller")
    }),
    comment: "Answer to a step of a calibration update or reading, to the tool",
    ..UPDATE_COMMAND
}
.carried();
