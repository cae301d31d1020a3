//! Task `link in`: decodes received bytes into commands.
//!
//! Calibrations are decoded and checked here, so that an invalid one never reaches the estimate task. A rejected
//! frame becomes a command as well, and is answered in order.

use embassy_sync::blocking_mutex::raw::RawMutex;
use embedded_io_async::Read;
use kou_estimator::Params;
use kou_estimator::record;

use super::channels::{ServerChannels, ServerCommand};
use super::link_end::LinkEnd;
use crate::link::{CalibrationRejection, ErrorKind, FrameDecoder, FrameError, Request, decode_request};
use crate::log::log;

/// Reads requests until the line ends. `chunk` is the buffer of one read.
pub async fn run_link_in<M: RawMutex>(
    channels: &ServerChannels<M>,
    line: &mut impl Read,
    chunk: &mut [u8],
) -> LinkEnd {
    let mut decoder = FrameDecoder::<{ crate::link::MAX_BODY }>::new();
    loop {
        let received = match line.read(chunk).await {
            Ok(0) => return LinkEnd::Closed,
            Ok(received) => received,
            Err(_) => return LinkEnd::Failed,
        };
        for &byte in chunk.iter().take(received) {
            if let Some(frame) = decoder.push(byte) {
                let command = command(channels, frame.and_then(decode_request)).await;
                channels.in_flight.begin();
                channels.commands.send(command).await;
            }
        }
    }
}

/// Command of a request or of a rejected frame.
async fn command<M: RawMutex>(
    channels: &ServerChannels<M>,
    request: Result<Request<'_>, FrameError>,
) -> ServerCommand {
    let request = match request {
        Ok(request) => {
            channels.counters.frames_ok.increment();
            request
        }
        Err(error) => {
            channels.counters.of_error(error).increment();
            return ServerCommand::ReportError(ErrorKind::Frame(error));
        }
    };
    match request {
        Request::Hello => ServerCommand::Hello,
        Request::LoadCalibration(bytes) => match read_calibration(bytes) {
            Ok((params, crc)) => {
                channels.counters.calibrations_accepted.increment();
                channels.candidate.send(params).await;
                ServerCommand::Adopt { crc }
            }
            Err(rejection) => {
                channels.counters.calibrations_rejected.increment();
                log!(warn, "calibration rejected");
                ServerCommand::Reject(rejection)
            }
        },
        Request::Sample(sample) => {
            channels.counters.samples.increment();
            ServerCommand::Sample(sample)
        }
        Request::Status => ServerCommand::Status,
        Request::Shutdown => ServerCommand::Shutdown,
    }
}

/// Parameters and CRC-32 of an intact record whose every field passes its check.
// Not inlined: its large temporaries would otherwise occupy the task's memory permanently.
#[inline(never)]
fn read_calibration(bytes: &[u8]) -> Result<(Params, u32), CalibrationRejection<&'static str>> {
    let calibration = record::calibration::decode(bytes)?;
    let params = Params::new(&calibration)?;
    let crc = bytes.last_chunk().map_or(0, |crc| u32::from_le_bytes(*crc));
    Ok((params, crc))
}
