//! Every message that the controller sends or understands, described once: encode, decode and the DBC file
//! (`kou.dbc`) are all made from these tables. `docs/can.md` explains them.
//!
//! Groups and parameters of the standard are those of SAE J1939-71 (shafts, pressure, temperature), -73 (diagnostics),
//! -21 (transport, request) and -81 (address claim). The controller's own groups are proprietary B (0xFF40 to 0xFF45), and
//! proprietary A for the calibration update.

mod drive;
mod estimates;
mod network;
mod troubles;
mod update;

pub use drive::*;
pub use estimates::*;
pub use network::*;
pub use troubles::*;
pub use update::*;

use super::signal::{Coding, Message, Signal};

const fn plain(name: &'static str, start: u8, length: u8, comment: &'static str) -> Signal {
    Signal {
        name: text(name),
        spn: None,
        start,
        length,
        coding: Coding::Plain,
        scale: 1.0,
        offset: 0.0,
        unit: "",
        values: &[],
        comment: text(comment),
    }
}

/// Texts are for the DBC file, which the host writes: firmware does without their kilobytes.
const fn text(text: &'static str) -> &'static str {
    if cfg!(target_os = "none") { "" } else { text }
}

impl Message {
    /// The message as firmware carries it: without what only the DBC file tells. On the host, whole.
    const fn carried(self) -> Self {
        if cfg!(target_os = "none") { Self { name: "", signals: &[], comment: "", ..self } } else { self }
    }
}

const fn state(
    name: &'static str,
    start: u8,
    length: u8,
    values: &'static [(u32, &'static str)],
    comment: &'static str,
) -> Signal {
    let values = if cfg!(target_os = "none") { &[] } else { values };
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
    Signal { coding: Coding::Measured, scale, offset, unit: text(unit), ..plain(name, 8 * byte, 16, comment) }
}

const fn with_spn(signal: Signal, spn: u32) -> Signal {
    Signal { spn: Some(spn), ..signal }
}

/// Every message.
pub const ALL: &[Message] = &[
    ETC1,
    HPG,
    TRF1,
    LEAKAGE,
    LEAKAGE_SE,
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
