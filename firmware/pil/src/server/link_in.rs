//! Task `link in`: bytes from the line into commands.
//!
//! Calibrations are decoded and checked here, so that a wrong one never reaches the estimate task. Whatever is no
//! request becomes a complaint, which is answered in its turn like everything else.

use embassy_sync::blocking_mutex::raw::RawMutex;
use embedded_io_async::Read;
use kou_estimator::Params;
use kou_estimator::calibration::record;

use super::channels::{ServerChannels, ServerCommand};
use super::link_end::LinkEnd;
use crate::link::{CalibrationRejection, ErrorKind, FrameDecoder, FrameError, Request, decode_request};
use crate::log::log;

/// Reads requests until the line ends. `chunk` is the buffer of one read.
pub async fn run_link_in<M: RawMutex>(
    bus: &ServerChannels<M>,
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
                let command = command(bus, frame.and_then(decode_request)).await;
                bus.in_flight.begin();
                bus.commands.send(command).await;
            }
        }
    }
}

/// Turns a request, or what was none, into a command.
async fn command<M: RawMutex>(
    bus: &ServerChannels<M>,
    request: Result<Request<'_>, FrameError>,
) -> ServerCommand {
    let request = match request {
        Ok(request) => {
            bus.counters.frames_ok.increment();
            request
        }
        Err(error) => {
            bus.counters.of_error(error).increment();
            return ServerCommand::ReportError(ErrorKind::Frame(error));
        }
    };
    match request {
        Request::Hello => ServerCommand::Hello,
        Request::LoadCalibration(bytes) => match read_calibration(bytes) {
            Ok((params, crc)) => {
                bus.counters.calibrations_accepted.increment();
                bus.candidate.send(params).await;
                ServerCommand::Adopt { crc }
            }
            Err(rejection) => {
                bus.counters.calibrations_rejected.increment();
                log!(warn, "calibration refused");
                ServerCommand::Reject(rejection)
            }
        },
        Request::Sample(sample) => {
            bus.counters.samples.increment();
            ServerCommand::Sample(sample)
        }
        Request::Status => ServerCommand::Status,
        Request::Shutdown => ServerCommand::Shutdown,
    }
}

/// Parameters of a record that is whole and whose every field passes its check, with the record's CRC-32.
// Not inlined: its temporaries are large, and inlined they would live in the task for good.
#[inline(never)]
fn read_calibration(bytes: &[u8]) -> Result<(Params, u32), CalibrationRejection<&'static str>> {
    let calibration = record::decode(bytes)?;
    let params = Params::new(&calibration)?;
    let crc = bytes.last_chunk().map_or(0, |crc| u32::from_le_bytes(*crc));
    Ok((params, crc))
}
