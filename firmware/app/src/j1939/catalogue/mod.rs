//! Message catalogue: every message sent or received, described once. Encoder, decoder and the DBC file (`kou.dbc`)
//! are generated from these tables, which `docs/can.md` explains.
//!
//! Standard groups and parameters are those of SAE J1939-71 (shafts, pressure, temperature), -73 (diagnostics), -21
//! (transport, request) and -81 (address claim). The controller's own groups are proprietary B (0xFF40 to 0xFF45),
//! and proprietary A for the calibration update.

mod builders;
mod diagnostics;
mod drive;
mod estimates;
mod network;
mod update;

pub use diagnostics::*;
pub use drive::*;
pub use estimates::*;
pub use network::*;
pub use update::*;

use super::signal::Message;

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
    use crate::j1939::signal::Coding;

    #[test]
    fn signals_lie_within_their_messages_without_overlap_and_have_unique_names() {
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
    fn names_of_channels_and_faults_match_the_estimator() {
        let same = |text: &str, name: &str| text.replace(' ', "_") == name;
        for ((number, text), fault) in FAULTS.iter().zip(Fault::ALL) {
            assert!(same(text, fault.name()), "{number}");
        }
        assert_eq!((FAULTS.len(), CHANNELS.len()), (Fault::ALL.len(), Channel::ALL.len()));
    }
}
