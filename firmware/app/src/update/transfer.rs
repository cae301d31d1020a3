//! The tool's side of an update: the commands, one after the other. Each is sent when the one before was answered well.

use kou_estimator::calibration::record::MAX_LEN;

use super::mac::{self, Key, TAG_LEN};
use super::sizes::MAX_TRANSFER;
use super::wire::{SEGMENT, UpdateCommand, segment};
use crate::diagnostics::RejectReason;

/// One update, ready to be sent.
#[derive(Debug, Clone)]
pub struct UpdateTransfer {
    bytes: heapless::Vec<u8, MAX_TRANSFER>,
    length: u16,
    counter: u32,
}

impl UpdateTransfer {
    /// Puts record and tag together.
    ///
    /// # Errors
    /// [`RejectReason::Length`] for bytes that are no record by their length.
    pub fn new(record: &[u8], counter: u32, key: &Key) -> Result<Self, RejectReason> {
        let tag = mac::tag(key, counter, record).ok_or(RejectReason::Length)?;
        Self::with_tag(record, counter, &tag)
    }

    /// As [`new`](Self::new), with a tag made elsewhere: where the key is kept by a server.
    ///
    /// # Errors
    /// As of [`new`](Self::new).
    pub fn with_tag(record: &[u8], counter: u32, tag: &[u8; TAG_LEN]) -> Result<Self, RejectReason> {
        if record.is_empty() || record.len() > MAX_LEN {
            return Err(RejectReason::Length);
        }
        let length = u16::try_from(record.len()).map_err(|_| RejectReason::Length)?;
        let mut bytes = heapless::Vec::new();
        bytes.extend_from_slice(record).map_err(|_| RejectReason::Length)?;
        bytes.extend_from_slice(tag).map_err(|_| RejectReason::Length)?;
        Ok(Self { bytes, length, counter })
    }

    /// The command of this number: begin, every segment, commit; then there is none.
    #[must_use]
    pub fn command(&self, number: usize) -> Option<UpdateCommand> {
        let segments = self.bytes.len().div_ceil(SEGMENT);
        match number.checked_sub(1) {
            None => Some(UpdateCommand::Begin { length: self.length, counter: self.counter }),
            Some(number) if number < segments => {
                let number = u8::try_from(number).ok()?;
                Some(UpdateCommand::Data { number, bytes: segment(&self.bytes, number)? })
            }
            Some(number) => (number == segments).then_some(UpdateCommand::Commit),
        }
    }

    /// All commands in order.
    pub fn commands(&self) -> impl Iterator<Item = UpdateCommand> {
        (0..).map_while(|number| self.command(number))
    }
}
