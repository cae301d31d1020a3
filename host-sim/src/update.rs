//! The tool's side of a calibration update over CAN: key file, frames, and a log of them that CAN tools play.
//!
//! The bytes of the commands and the tag are made by the firmware's own code (`kou_app::update`);
//! `docs/calibration-update.md` describes both.

use std::fmt::Write;
use std::fs::File;
use std::io::Read;
use std::path::Path;

use kou_app::j1939::catalogue::UPDATE_COMMAND;
use kou_app::j1939::{Frame, Id};
use kou_app::update::provision::KEY_LEN;
use kou_app::update::{Key, UpdateTransfer};
use kou_estimator::Calibration;
use kou_estimator::record;

use kou_records::InputError;

/// Bytes that are read of a key file: more than digits and white space around them need, and a wrong file may be endless.
const LONGEST_KEY_FILE: u64 = 1024;

/// Who talks to whom.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Addresses {
    /// Source address that the controller has claimed.
    pub controller: u8,
    /// Source address of the tool; 0xF9 is the service tool's by the standard.
    pub tool: u8,
}

/// Reads a key: a file of 32 bytes, or of 64 hexadecimal digits and white space.
///
/// # Errors
/// When the file cannot be read or holds something else. The message never shows what it holds.
pub fn read_key(path: &Path) -> Result<Key, InputError> {
    read_key_bytes(path).map(Key::new)
}

/// The bytes of a key file, for what is written into a controller.
///
/// # Errors
/// As of [`read_key`].
pub fn read_key_bytes(path: &Path) -> Result<[u8; KEY_LEN], InputError> {
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|file| file.take(LONGEST_KEY_FILE).read_to_end(&mut bytes))
        .map_err(|e| InputError::new(format!("{}: {e}", path.display())))?;
    let is_text = |byte: &u8| byte.is_ascii_hexdigit() || byte.is_ascii_whitespace();
    // 32 bytes of digits are half a key in text, not a key: random bytes look so once in 1e31 keys.
    if let Ok(raw) = <[u8; KEY_LEN]>::try_from(bytes.as_slice())
        && !raw.iter().all(is_text)
    {
        return Ok(raw);
    }
    let digits: Option<Vec<u8>> = bytes
        .iter()
        .filter(|byte| !byte.is_ascii_whitespace())
        .map(|byte| char::from(*byte).to_digit(16).and_then(|digit| u8::try_from(digit).ok()))
        .collect();
    let key = digits.filter(|digits| digits.len() == 64).map(|digits| {
        std::array::from_fn(|i| digits.get(2 * i).unwrap_or(&0) << 4 | digits.get(2 * i + 1).unwrap_or(&0))
    });
    key.ok_or_else(|| {
        InputError::new(format!("{}: a key is 32 bytes, or 64 hexadecimal digits", path.display()))
    })
}

/// The frames of one update, in order. Each is to be sent when the controller has answered the one before.
///
/// # Errors
/// When the calibration fits no record.
pub fn frames(
    calibration: &Calibration,
    counter: u32,
    key: &Key,
    addresses: Addresses,
) -> Result<Vec<Frame>, InputError> {
    let mut buffer = [0; record::calibration::MAX_LEN];
    let length =
        record::calibration::encode(calibration, &mut buffer).map_err(|e| InputError::new(e.to_string()))?;
    let bytes = buffer.get(..length).unwrap_or_default();
    let transfer = UpdateTransfer::new(bytes, counter, key).map_err(|e| InputError::new(e.to_string()))?;
    let id = Id::new(UPDATE_COMMAND.priority, UPDATE_COMMAND.pgn, addresses.controller, addresses.tool);
    Ok(transfer.commands().map(|command| Frame::new(id, command.to_bytes())).collect())
}

/// Frames as a log in candump's format, `spacing_ms` apart: `canplayer -I FILE` sends it.
#[must_use]
pub fn candump(frames: &[Frame], spacing_ms: u32) -> String {
    let mut log = String::new();
    for (number, frame) in (0_u32..).zip(frames) {
        let seconds = f64::from(number) * f64::from(spacing_ms) * 1e-3;
        let data: String = frame.data().iter().map(|byte| format!("{byte:02X}")).collect();
        // Writing to a string cannot fail.
        writeln!(log, "({seconds:.6}) can0 {:08X}#{data}", frame.id().raw()).ok();
    }
    log
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_is_read_as_bytes_and_as_digits_and_anything_else_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str, content: &[u8]| {
            let path = folder.path().join(name);
            std::fs::write(&path, content).unwrap();
            read_key(&path)
        };
        let raw: [u8; 32] = std::array::from_fn(|i| 0xE0 ^ i as u8);
        let digits: String = raw.iter().map(|byte| format!("{byte:02x}")).collect();
        assert_eq!(file("raw", &raw).unwrap(), Key::new(raw));
        assert_eq!(file("hex", format!("{digits}\n").as_bytes()).unwrap(), Key::new(raw));
        let digits = digits.as_bytes();
        // The last two are 32 bytes long.
        let half = [&digits[..31], b"\n"].concat();
        for wrong in [&raw[..31], &digits[1..], b"", "g".repeat(64).as_bytes(), &digits[..32], &half] {
            let error = file("wrong", wrong).unwrap_err().to_string();
            assert!(error.contains("32 bytes"), "{error}");
        }
        assert_eq!(format!("{:?}", Key::new(raw)), "Key(..)", "a key is never printed");
    }
}
