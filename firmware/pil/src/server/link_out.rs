//! Task `link out`: responses into frames on the line.
//!
//! Responses that wait are written together, because a write has a price of its own on most lines (an interrupt, a DMA
//! transfer, a semihosting call); nothing is held back once no further response waits.

use embassy_sync::blocking_mutex::raw::RawMutex;
use embedded_io_async::Write;

use super::channels::{QUEUE_LEN, ServerChannels};
use super::link_end::LinkEnd;
use crate::link::{CRC_LEN, MAX_RESPONSE_FRAME, MAX_RESPONSE_PAYLOAD, Response, encode};

/// Room for as many estimates as can wait; an estimate takes some 60 bytes.
const BATCH_LEN: usize = 64 * QUEUE_LEN + MAX_RESPONSE_FRAME;
const BODY: usize = MAX_RESPONSE_PAYLOAD + CRC_LEN;

/// Writes responses until the host asked for the end or the line fails.
pub async fn run_link_out<M: RawMutex>(bus: &ServerChannels<M>, line: &mut impl Write) -> LinkEnd {
    let mut batch = [0; BATCH_LEN];
    loop {
        let mut used: usize = 0;
        let mut answered: u32 = 0;
        let mut last = false;
        let mut next = Some(bus.responses.receive().await);
        while let Some(response) = next {
            let Some(space) = batch.get_mut(used..) else { return LinkEnd::Failed };
            // Cannot fail: the largest response fits, and a test encodes it. Without an answer the link is broken.
            let Ok(len) = encode::<BODY>(&response, space) else { return LinkEnd::Failed };
            used = used.saturating_add(len);
            answered = answered.saturating_add(1);
            last = matches!(response, Response::ShuttingDown);
            let room = BATCH_LEN.saturating_sub(used) >= MAX_RESPONSE_FRAME;
            next = if room && !last { bus.responses.try_receive().ok() } else { None };
        }
        if line.write_all(batch.get(..used).unwrap_or_default()).await.is_err() || line.flush().await.is_err()
        {
            return LinkEnd::Failed;
        }
        bus.in_flight.complete(answered);
        if last {
            return LinkEnd::Shutdown;
        }
    }
}
