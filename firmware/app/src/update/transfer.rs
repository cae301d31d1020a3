//! Tool side of an update: its commands in order, each to be sent after a positive answer to the previous one.

use kou_estimator::record::calibration::MAX_LEN;

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
    /// Combines record and tag.
    ///
    /// # Errors
    /// [`RejectReason::Length`] for a length that no record has.
    pub fn new(record: &[u8], counter: u32, key: &Key) -> Result<Self, RejectReason> {
        let tag = mac::tag(key, counter, record).ok_or(RejectReason::Length)?;
        Self::with_tag(record, counter, &tag)
    }

    /// As [`new`](Self::new), with a tag made elsewhere, for instance by a key server.
    ///
    /// # Errors
    /// Those of [`new`](Self::new).
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

    /// Command of a number: begin, every segment, commit; then `None`.
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
