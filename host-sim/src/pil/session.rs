//! Session with the firmware: frames out, frames in, with a limit on every wait.

use std::collections::VecDeque;
use std::time::Instant;

use kou_pil::link::{
    FrameDecoder, FrameError, Hello, MAX_BODY, MAX_FRAME, PROTOCOL, Request, Response, Status,
    decode_response, encode,
};

use super::error::PilError;
use super::options::PilOptions;
use super::qemu::Qemu;
use super::qemu_link::QemuLink;

/// A response of the firmware.
pub type FirmwareResponse = Response<String>;

/// Bytes that one write transfers at once (POSIX: at least 512, Linux: 4096), and that the firmware reads at once.
pub const BATCH_LEN: usize = 4096;

/// A running firmware that has answered the first request. Dropped, QEMU is killed.
pub struct PilSession {
    link: QemuLink,
    decoder: FrameDecoder<MAX_BODY>,
    ready: VecDeque<Result<FirmwareResponse, FrameError>>,
    hello: Hello<String>,
}

/// Exit of a firmware.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FirmwareExit {
    /// QEMU's exit code; `docs/firmware.md` lists them.
    pub code: Option<i32>,
    /// The firmware's log, encoded by defmt.
    pub log: Vec<u8>,
    /// Text output of the firmware: empty unless it failed.
    pub printed: String,
}

impl PilSession {
    /// Starts the firmware and exchanges hellos.
    ///
    /// # Errors
    /// When QEMU or the firmware is missing, does not start, does not answer or speaks another protocol.
    pub fn start(options: &PilOptions) -> Result<Self, PilError> {
        let mut session = Self {
            link: QemuLink::start(options, options.transport.arguments())?,
            decoder: FrameDecoder::new(),
            ready: VecDeque::new(),
            hello: Hello { protocol: 0, record_schema: 0, version: String::new(), board: String::new() },
        };
        let hello = session.request(&Request::Hello)?;
        session.link.release_spare_ends();
        match hello {
            Response::Hello(hello) if hello.protocol == PROTOCOL => session.hello = hello,
            Response::Hello(hello) => {
                return Err(PilError::Version { firmware: hello.protocol, host: PROTOCOL });
            }
            other => return Err(unexpected("hello", &other)),
        }
        Ok(session)
    }

    /// Identification that the firmware sent.
    #[must_use]
    pub fn hello(&self) -> &Hello<String> {
        &self.hello
    }

    /// Sends one request and waits for its response.
    ///
    /// # Errors
    /// When the firmware ends or falls silent, or its response is damaged.
    pub fn request(&mut self, request: &Request<'_>) -> Result<FirmwareResponse, PilError> {
        self.send_raw(frame(request)?)?;
        match self.receive()? {
            Ok(response) => Ok(response),
            Err(error) => Err(PilError::Unexpected { request: name(request), answer: error.to_string() }),
        }
    }

    /// Sends bytes as they are, valid or not. The caller counts the responses.
    ///
    /// # Errors
    /// When the firmware has ended.
    pub fn send_raw(&mut self, bytes: Vec<u8>) -> Result<(), PilError> {
        self.link.send(bytes)
    }

    /// Waits for the next frame from the firmware; a frame that is no response is returned as its error.
    ///
    /// # Errors
    /// When the firmware ends or falls silent.
    pub fn receive(&mut self) -> Result<Result<FirmwareResponse, FrameError>, PilError> {
        let since = Instant::now();
        loop {
            if let Some(frame) = self.ready.pop_front() {
                return Ok(frame);
            }
            for byte in self.link.receive(since)? {
                if let Some(frame) = self.decoder.push(byte) {
                    self.ready.push_back(frame.and_then(decode_response));
                }
            }
        }
    }

    /// Loads a calibration record and returns the CRC-32 under which the firmware accepted it.
    ///
    /// # Errors
    /// When the firmware rejects it, with the reason, and as for [`Self::request`].
    pub fn load_calibration(&mut self, record: &[u8]) -> Result<u32, PilError> {
        match self.request(&Request::LoadCalibration(record))? {
            Response::CalibrationAccepted { crc } => Ok(crc),
            Response::CalibrationRejected(rejection) => Err(PilError::CalibrationRejected(rejection)),
            other => Err(unexpected("load calibration", &other)),
        }
    }

    /// The firmware's counters.
    ///
    /// # Errors
    /// As for [`Self::request`].
    pub fn status(&mut self) -> Result<Status, PilError> {
        match self.request(&Request::Status)? {
            Response::Status(status) => Ok(status),
            other => Err(unexpected("status", &other)),
        }
    }

    /// Asks the firmware to end and waits until it has.
    ///
    /// # Errors
    /// As for [`Self::request`], and when the firmware does not end in time. Its exit code is the caller's to judge.
    pub fn shut_down(mut self) -> Result<FirmwareExit, PilError> {
        match self.request(&Request::Shutdown)? {
            Response::ShuttingDown => {}
            other => return Err(unexpected("shutdown", &other)),
        }
        self.exit()
    }

    /// Closes the link without a message, as a host does that dies, and waits for the firmware to end.
    ///
    /// # Errors
    /// When the firmware does not end in time.
    pub fn hang_up(mut self) -> Result<FirmwareExit, PilError> {
        self.link.close();
        self.exit()
    }

    fn exit(mut self) -> Result<FirmwareExit, PilError> {
        let code = self.link.wait()?;
        Ok(FirmwareExit { code, log: self.link.log(), printed: self.link.printed().0 })
    }
}

/// Runs a binary without a link, such as one that fails on purpose, to its exit.
///
/// # Errors
/// When QEMU or the binary is missing, or does not end in time.
pub fn run_to_end(options: &PilOptions, arguments: &[&str]) -> Result<FirmwareExit, PilError> {
    let directory = tempfile::tempdir().map_err(PilError::system("making a working directory for QEMU"))?;
    let mut qemu = Qemu::start(options, arguments, directory.path())?;
    let code = qemu.wait(options.timeout)?;
    Ok(FirmwareExit { code, log: qemu.log(), printed: qemu.printed().0 })
}

/// One request as a frame.
///
/// # Errors
/// When the request is too large for any frame.
pub fn frame(request: &Request<'_>) -> Result<Vec<u8>, PilError> {
    let mut bytes = vec![0; MAX_FRAME];
    let len = encode::<MAX_BODY>(request, &mut bytes)?;
    bytes.truncate(len);
    Ok(bytes)
}

pub(super) fn unexpected(request: &'static str, answer: &FirmwareResponse) -> PilError {
    PilError::Unexpected { request, answer: format!("{answer:?}") }
}

fn name(request: &Request<'_>) -> &'static str {
    match request {
        Request::Hello => "hello",
        Request::LoadCalibration(_) => "load calibration",
        Request::Sample(_) => "sample",
        Request::Status => "status",
        Request::Shutdown => "shutdown",
    }
}
