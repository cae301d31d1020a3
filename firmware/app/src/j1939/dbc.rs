//! DBC file, generated from the [catalogue](super::catalogue). Unused on the target, where the linker removes it.

use core::fmt::{self, Write};

use super::catalogue::ALL;
use super::id::{GLOBAL, Id, NULL_ADDRESS};
use super::node::UPDATE;
use super::signal::{Message, Sender};

/// Source address of a service tool in the file.
const TOOL_ADDRESS: u8 = 0xF9;
/// Bit that marks a 29-bit identifier in a DBC file.
const EXTENDED: u32 = 1 << 31;

const SENDERS: [Sender; 3] = [Sender::Kou, Sender::Drive, Sender::Tool];

/// Identifier of a message in the file. Source addresses are claimed at run time, so the null address represents
/// them; tools compare the parameter group, as the attribute `VFrameFormat` = `J1939PG` states. Command and answer of
/// an update share a group and differ by their source.
#[must_use]
pub const fn file_id(message: &Message) -> u32 {
    let is_update = message.pgn.get() == UPDATE.get();
    let (destination, source) = match message.sender {
        Sender::Tool if is_update => (NULL_ADDRESS, TOOL_ADDRESS),
        Sender::Tool => (GLOBAL, TOOL_ADDRESS),
        Sender::Kou if is_update => (TOOL_ADDRESS, NULL_ADDRESS),
        Sender::Kou | Sender::Drive => (GLOBAL, NULL_ADDRESS),
    };
    Id::new(message.priority, message.pgn, destination, source).raw() | EXTENDED
}

/// Writes the file.
///
/// # Errors
/// Those of `out`.
pub fn write(out: &mut impl Write) -> fmt::Result {
    out.write_str("VERSION \"\"\n\n\nNS_ :\n\nBS_:\n\nBU_:")?;
    for sender in SENDERS {
        write!(out, " {}", sender.name())?;
    }
    out.write_str("\n\n\n")?;
    for message in ALL {
        layout(out, message)?;
    }
    out.write_str(
        "CM_ \"Messages of the leakage estimator's controller (SAE J1939). Generated from the firmware's message \
         catalogue; do not edit.\";\n",
    )?;
    for message in ALL {
        comments(out, message)?;
    }
    out.write_str(
        "BA_DEF_ \"ProtocolType\" STRING ;\n\
         BA_DEF_ BO_ \"VFrameFormat\" ENUM \"StandardCAN\",\"ExtendedCAN\",\"reserved\",\"J1939PG\";\n\
         BA_DEF_ BO_ \"GenMsgCycleTime\" INT 0 65535;\n\
         BA_DEF_ SG_ \"SPN\" INT 0 524287;\n\
         BA_DEF_DEF_ \"ProtocolType\" \"J1939\";\n\
         BA_DEF_DEF_ \"VFrameFormat\" \"J1939PG\";\n\
         BA_DEF_DEF_ \"GenMsgCycleTime\" 0;\n\
         BA_DEF_DEF_ \"SPN\" 0;\n\
         BA_ \"ProtocolType\" \"J1939\";\n",
    )?;
    for message in ALL {
        attributes(out, message)?;
    }
    ALL.iter().try_for_each(|message| value_names(out, message))
}

fn layout(out: &mut impl Write, message: &Message) -> fmt::Result {
    let sender = message.sender.name();
    writeln!(out, "BO_ {} {}: {} {sender}", file_id(message), message.name, message.length)?;
    for signal in message.signals {
        write!(out, " SG_ {} : {}|{}@1+ ", signal.name, signal.start, signal.length)?;
        write!(out, "({},{}) ", signal.scale, signal.offset)?;
        if signal.is_raw() {
            write!(out, "[0|{}] ", signal.raw_max())?;
        } else {
            let (min, max) = signal.range();
            write!(out, "[{min}|{max}] ")?;
        }
        write!(out, "\"{}\" ", signal.unit)?;
        out.write_str(if message.sender == Sender::Kou { "Drive,Tool\n" } else { "Kou\n" })?;
    }
    out.write_str("\n")
}

fn comments(out: &mut impl Write, message: &Message) -> fmt::Result {
    writeln!(out, "CM_ BO_ {} \"{}\";", file_id(message), message.comment)?;
    message.signals.iter().try_for_each(|signal| {
        writeln!(out, "CM_ SG_ {} {} \"{}\";", file_id(message), signal.name, signal.comment)
    })
}

fn attributes(out: &mut impl Write, message: &Message) -> fmt::Result {
    let id = file_id(message);
    writeln!(out, "BA_ \"VFrameFormat\" BO_ {id} 3;")?;
    if message.period_ms > 0 {
        writeln!(out, "BA_ \"GenMsgCycleTime\" BO_ {id} {};", message.period_ms)?;
    }
    for signal in message.signals {
        if let Some(spn) = signal.spn {
            writeln!(out, "BA_ \"SPN\" SG_ {id} {} {spn};", signal.name)?;
        }
    }
    Ok(())
}

fn value_names(out: &mut impl Write, message: &Message) -> fmt::Result {
    for signal in message.signals.iter().filter(|signal| !signal.values.is_empty()) {
        write!(out, "VAL_ {} {}", file_id(message), signal.name)?;
        for (raw, name) in signal.values {
            write!(out, " {raw} \"{name}\"")?;
        }
        out.write_str(" ;\n")?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::string::String;

    #[test]
    fn shipped_dbc_file_matches_the_catalogue() {
        let mut text = String::new();
        super::write(&mut text).unwrap();
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("kou.dbc");
        let shipped = std::fs::read_to_string(&path).unwrap_or_default();
        assert!(
            shipped == text,
            "firmware/app/kou.dbc differs from the catalogue; write it again with `host-sim dbc --out \
             firmware/app/kou.dbc` and review the difference"
        );
    }
}
