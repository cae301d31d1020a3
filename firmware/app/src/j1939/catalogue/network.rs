//! Requests, acknowledgements, address claim and transport protocol (J1939-21 and -81).

use super::builders::{plain, with_spn};
use crate::j1939::id::Pgn;
use crate::j1939::signal::{Message, Sender, Signal};

/// Requested group.
pub const REQUESTED_PGN: Signal = plain("RequestedPgn", 0, 24, "Parameter group that is asked for");
/// Request for a parameter group.
pub const REQUEST: Message = Message {
    name: "Request",
    pgn: Pgn::new(59904),
    priority: 6,
    length: 3,
    period_ms: 0,
    sender: Sender::Tool,
    signals: &[REQUESTED_PGN],
    comment: "Request for a parameter group: DM1, DM2, AddressClaimed",
}
.carried();
/// Acknowledgement control byte.
pub const ACK_CONTROL: Signal = Signal {
    values: &[(0, "positive"), (1, "negative"), (2, "access denied"), (3, "cannot respond")],
    ..plain("AckControl", 0, 8, "Kind of acknowledgement")
};
/// Address of the requester.
pub const ACK_ADDRESS: Signal = plain("AckAddress", 32, 8, "Address that asked");
/// Requested group.
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
}
.carried();
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
}
.carried();
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
}
.carried();
/// Sequence number of the packet.
pub const TP_SEQUENCE: Signal = plain("TpSequence", 0, 8, "Number of the packet, from 1");
/// Transport protocol, data transfer.
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
}
.carried();
