//! Task `link out`: encodes responses into frames on the line.
//!
//! Queued responses are written together, because a write has a fixed cost on most lines (an interrupt, a DMA
//! transfer, a semihosting call); nothing is delayed once the queue is empty.

use embassy_sync::blocking_mutex::raw::RawMutex;
use embedded_io_async::Write;

use super::channels::{QUEUE_LEN, ServerChannels};
use super::link_end::LinkEnd;
use crate::link::{CRC_LEN, MAX_RESPONSE_FRAME, MAX_RESPONSE_PAYLOAD, Response, encode};

/// Room for as many estimates as can be queued; an estimate takes about 60 bytes.
const BATCH_LEN: usize = 64 * QUEUE_LEN + MAX_RESPONSE_FRAME;
const BODY: usize = MAX_RESPONSE_PAYLOAD + CRC_LEN;

/// Writes responses until the host requests a shutdown or the line fails.
pub async fn run_link_out<M: RawMutex>(channels: &ServerChannels<M>, line: &mut impl Write) -> LinkEnd {
    let mut batch = [0; BATCH_LEN];
    loop {
        let mut used: usize = 0;
        let mut answered: u32 = 0;
        let mut last = false;
        let mut next = Some(channels.responses.receive().await);
        while let Some(response) = next {
            let Some(space) = batch.get_mut(used..) else { return LinkEnd::Failed };
            // Cannot fail: the largest response fits, as a test verifies. Without an answer the link is broken.
            let Ok(len) = encode::<BODY>(&response, space) else { return LinkEnd::Failed };
            used = used.saturating_add(len);
            answered = answered.saturating_add(1);
            last = matches!(response, Response::ShuttingDown);
            let room = BATCH_LEN.saturating_sub(used) >= MAX_RESPONSE_FRAME;
            next = if room && !last { channels.responses.try_receive().ok() } else { None };
        }
        if line.write_all(batch.get(..used).unwrap_or_default()).await.is_err() || line.flush().await.is_err()
        {
            return LinkEnd::Failed;
        }
        channels.in_flight.complete(answered);
        if last {
            return LinkEnd::Shutdown;
        }
    }
}
