//! All tasks together, on the host, on a line in memory.

use core::future::Future;
use core::pin::pin;
use std::vec;
use std::vec::Vec;

use embassy_futures::select::select4;
use embassy_futures::{block_on, poll_once};
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_time::{Duration, MockDriver};
use embedded_io_async::{ErrorKind, ErrorType, Read, Write};
use kou_estimator::Sample;
use kou_estimator::units::Micros;

use super::*;
use crate::link::ErrorKind as ErrorKindOfLink;
use crate::link::Response;
use crate::link::{FrameDecoder, FrameError, MAX_BODY, MAX_FRAME, Request, decode_response, encode};

struct TestBoard;

impl Board for TestBoard {
    const NAME: &'static str = "memory";

    fn stack_high_water_bytes(&self) -> u32 {
        1234
    }

    fn uptime_us(&self) -> u64 {
        5678
    }
}

/// Line that returns `piece` bytes at a time and then closes; like semihosting, only when all is answered.
struct MemoryLine<'a> {
    bytes: &'a [u8],
    piece: usize,
    in_flight: Option<&'a InFlight<NoopRawMutex>>,
}

impl ErrorType for MemoryLine<'_> {
    type Error = ErrorKind;
}

impl Read for MemoryLine<'_> {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, ErrorKind> {
        if let Some(in_flight) = self.in_flight {
            in_flight.wait_idle().await;
        }
        let len = self.piece.min(buffer.len()).min(self.bytes.len());
        let (now, later) = self.bytes.split_at(len);
        buffer[..len].copy_from_slice(now);
        self.bytes = later;
        Ok(len)
    }
}

#[derive(Default)]
struct WrittenBytes(Vec<u8>);

impl ErrorType for WrittenBytes {
    type Error = ErrorKind;
}

impl Write for WrittenBytes {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, ErrorKind> {
        self.0.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    async fn flush(&mut self) -> Result<(), ErrorKind> {
        Ok(())
    }
}

fn frames(requests: &[Request<'_>]) -> Vec<u8> {
    let mut all = Vec::new();
    for request in requests {
        let mut out = vec![0; MAX_FRAME];
        let len = encode::<MAX_BODY>(request, &mut out).unwrap();
        all.extend_from_slice(&out[..len]);
    }
    all
}

/// Responses of the firmware to `bytes`, read `piece` at a time.
fn answers(bytes: &[u8], piece: usize, blocking: bool) -> Vec<Response<std::string::String>> {
    let channels = ServerChannels::<NoopRawMutex>::new();
    let mut written = WrittenBytes::default();
    let in_flight = blocking.then_some(&channels.in_flight);
    let mut line = MemoryLine { bytes, piece, in_flight };
    let mut chunk = [0; 64];
    block_on(select4(
        run_link_out(&channels, &mut written),
        run_estimate(&channels, &TestBoard),
        async {
            assert_eq!(run_link_in(&channels, &mut line, &mut chunk).await, LinkEnd::Closed);
            channels.in_flight.wait_idle().await;
        },
        never(),
    ));
    let mut decoder = FrameDecoder::<MAX_BODY>::new();
    let mut all = Vec::new();
    for byte in written.0 {
        if let Some(frame) = decoder.push(byte) {
            all.push(decode_response(frame.unwrap()).unwrap());
        }
    }
    all
}

fn never() -> impl Future<Output = ()> {
    core::future::pending()
}

#[test]
fn every_request_has_one_answer_in_order_however_the_bytes_arrive() {
    // More requests than the queues hold, so that every task is blocked at some time.
    let mut bytes = Vec::new();
    for i in 0..200_u64 {
        bytes.extend(frames(&[Request::Sample(Sample::empty(Micros(i)))]));
        if i % 3 == 0 {
            bytes.extend(frames(&[Request::Hello]));
        }
        if i % 5 == 0 {
            bytes.extend([7, 1, 2, 3, 4, 5, 6, 0, 0]);
        }
    }
    for piece in [1, 7, 64] {
        for blocking in [false, true] {
            let mut answers = answers(&bytes, piece, blocking).into_iter();
            for i in 0..200 {
                assert_eq!(answers.next(), Some(Response::Error(ErrorKindOfLink::NoCalibration)), "{i}");
                if i % 3 == 0 {
                    assert!(matches!(answers.next(), Some(Response::Hello(_))), "{i}");
                }
                if i % 5 == 0 {
                    let crc = Response::Error(ErrorKindOfLink::Frame(FrameError::Crc));
                    assert_eq!(answers.next(), Some(crc), "{i}");
                }
            }
            assert_eq!(answers.next(), None);
        }
    }
}

#[test]
fn invalid_record_is_rejected_and_counted() {
    let requests =
        [Request::LoadCalibration(b"KOUC nonsense"), Request::LoadCalibration(&[]), Request::Status];
    let answers = answers(&frames(&requests), 64, true);
    let [Response::CalibrationRejected(_), Response::CalibrationRejected(_), Response::Status(status)] =
        answers.as_slice()
    else {
        panic!("{answers:?}");
    };
    assert_eq!((status.counts.calibrations_rejected, status.counts.frames_ok), (2, 3));
    assert_eq!((status.stack_high_water_bytes, status.uptime_us), (1234, 5678));
    assert_eq!(status.calibration, None);
}

#[test]
fn shutdown_is_answered_before_the_link_ends() {
    let channels = ServerChannels::<NoopRawMutex>::new();
    let mut written = WrittenBytes::default();
    let bytes = frames(&[Request::Shutdown]);
    let mut line = MemoryLine { bytes: &bytes, piece: 64, in_flight: Some(&channels.in_flight) };
    let mut chunk = [0; 64];
    let end = block_on(select4(
        run_link_out(&channels, &mut written),
        run_estimate(&channels, &TestBoard),
        async {
            run_link_in(&channels, &mut line, &mut chunk).await;
            never().await;
        },
        never(),
    ));
    assert!(matches!(end, embassy_futures::select::Either4::First(LinkEnd::Shutdown)));
    assert_eq!(written.0, frames_of_shutting_down());
}

fn frames_of_shutting_down() -> Vec<u8> {
    let mut out = vec![0; MAX_FRAME];
    let len = encode::<MAX_BODY>(&ServerResponse::ShuttingDown, &mut out).unwrap();
    out.truncate(len);
    out
}

#[test]
fn heartbeat_counts_elapsed_periods_only() {
    let channels = ServerChannels::<NoopRawMutex>::new();
    let clock = MockDriver::get();
    let mut heartbeat = pin!(run_heartbeat(&channels, Duration::from_millis(100)));
    assert!(poll_once(heartbeat.as_mut()).is_pending());
    for beats in 1..=5 {
        clock.advance(Duration::from_millis(99));
        assert!(poll_once(heartbeat.as_mut()).is_pending());
        assert_eq!(channels.counters.heartbeats.get(), beats - 1);
        clock.advance(Duration::from_millis(1));
        assert!(poll_once(heartbeat.as_mut()).is_pending());
        assert_eq!(channels.counters.heartbeats.get(), beats);
    }
}
