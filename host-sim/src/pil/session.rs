//! A conversation with the firmware: frames out, frames in, with a limit on every wait.
//!
//! The line is a pair of FIFOs in a temporary directory. Opening and reading a FIFO can block for ever, and so can
//! writing to one, so threads do both and this side only ever waits on channels, with a limit. When QEMU ends, its ends
//! of the FIFOs close, and both threads end with them.

use std::collections::VecDeque;
use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::path::Path;
use std::process::Command;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::spawn;
use std::time::{Duration, Instant};

use kou_pil::link::{
    FrameDecoder, FrameError, Hello, MAX_BODY, MAX_FRAME, PROTOCOL, Request, Response, Status,
    decode_response, encode,
};
use tempfile::TempDir;

use super::PilOptions;
use super::error::PilError;
use super::qemu::Qemu;

/// An answer of the firmware.
pub type Reply = Response<String>;

/// Bytes that one write hands over whole (POSIX: at least 512, Linux: 4096), and that the firmware reads at once.
pub const BATCH_LEN: usize = 4096;

/// How often a wait looks whether QEMU still runs.
const GLANCE: Duration = Duration::from_millis(100);

/// The files' names are known to the firmware; without their endings, to QEMU's UART.
const REQUESTS: &str = "kou-link.in";
const RESPONSES: &str = "kou-link.out";

/// A firmware that runs and has said hello. Dropped, it is ended the hard way.
pub struct Session {
    // Declared first and so dropped first: the FIFOs' directory goes after QEMU.
    qemu: Qemu,
    outgoing: Sender<Vec<u8>>,
    incoming: Receiver<Vec<u8>>,
    decoder: FrameDecoder<MAX_BODY>,
    ready: VecDeque<Result<Reply, FrameError>>,
    options: PilOptions,
    hello: Hello<String>,
    _directory: TempDir,
}

/// How a firmware ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Ended {
    /// QEMU's exit code; `docs/firmware.md` lists them.
    pub code: Option<i32>,
    /// The firmware's log, encoded by defmt.
    pub log: Vec<u8>,
    /// What the firmware printed as text: nothing, unless something went wrong.
    pub printed: String,
}

impl Session {
    /// Starts the firmware and exchanges hellos.
    ///
    /// # Errors
    /// When QEMU or the firmware is missing, does not start, does not answer or speaks another protocol.
    pub fn start(options: &PilOptions) -> Result<Self, PilError> {
        let doing = PilError::system;
        let directory = tempfile::Builder::new()
            .prefix("kou-pil-")
            .tempdir()
            .map_err(doing("making a directory for the link's FIFOs"))?;
        let requests = directory.path().join(REQUESTS);
        let responses = directory.path().join(RESPONSES);
        make_fifos(&[&requests, &responses])?;
        // Opened for both directions a FIFO opens at once, and while these are open, so do all other ends.
        let both = |path: &Path| OpenOptions::new().read(true).write(true).open(path);
        let keep_requests = both(&requests).map_err(doing("opening the link's FIFO for requests"))?;
        let keep_responses = both(&responses).map_err(doing("opening the link's FIFO for responses"))?;
        let writer = OpenOptions::new().write(true).open(&requests);
        let writer = writer.map_err(doing("opening the link's FIFO for requests"))?;
        let reader = File::open(&responses).map_err(doing("opening the link's FIFO for responses"))?;
        let mut session = Self {
            qemu: Qemu::start(options, options.line.arguments(), directory.path())?,
            outgoing: write_in_background(writer),
            incoming: read_in_background(reader),
            decoder: FrameDecoder::new(),
            ready: VecDeque::new(),
            options: options.clone(),
            hello: Hello { protocol: 0, record_schema: 0, version: String::new(), board: String::new() },
            _directory: directory,
        };
        let hello = session.ask(&Request::Hello);
        // From here on the firmware alone holds the other ends, so its end is seen as the end of the line.
        drop((keep_requests, keep_responses));
        match hello? {
            Response::Hello(hello) if hello.protocol == PROTOCOL => session.hello = hello,
            Response::Hello(hello) => {
                return Err(PilError::Version { firmware: hello.protocol, host: PROTOCOL });
            }
            other => return Err(unexpected("hello", &other)),
        }
        Ok(session)
    }

    /// What the firmware said of itself.
    #[must_use]
    pub fn hello(&self) -> &Hello<String> {
        &self.hello
    }

    /// Sends one request and waits for its answer.
    ///
    /// # Errors
    /// When the firmware ends or falls silent, or its answer is damaged.
    pub fn ask(&mut self, request: &Request<'_>) -> Result<Reply, PilError> {
        self.send_raw(frame(request)?)?;
        match self.receive()? {
            Ok(reply) => Ok(reply),
            Err(error) => Err(PilError::Unexpected { request: name(request), answer: error.to_string() }),
        }
    }

    /// Puts bytes on the line as they are, good or bad. Whoever does so counts the answers.
    ///
    /// # Errors
    /// When the firmware has ended.
    pub fn send_raw(&mut self, bytes: Vec<u8>) -> Result<(), PilError> {
        if self.outgoing.send(bytes).is_ok() { Ok(()) } else { Err(self.gone()) }
    }

    /// Waits for the next frame from the firmware; a frame that is no response is given as what is wrong with it.
    ///
    /// # Errors
    /// When the firmware ends or falls silent.
    pub fn receive(&mut self) -> Result<Result<Reply, FrameError>, PilError> {
        let start = Instant::now();
        loop {
            if let Some(frame) = self.ready.pop_front() {
                return Ok(frame);
            }
            let bytes = match self.incoming.recv_timeout(GLANCE) {
                Ok(bytes) => bytes,
                Err(RecvTimeoutError::Disconnected) => return Err(self.gone()),
                Err(RecvTimeoutError::Timeout) => {
                    // A firmware that ended before its hello leaves no trace on the line, so look at QEMU, too.
                    if self.qemu.has_ended() {
                        return Err(self.gone());
                    }
                    if start.elapsed() < self.options.timeout {
                        continue;
                    }
                    self.qemu.kill();
                    let printed = self.qemu.printed();
                    return Err(PilError::Timeout { after: self.options.timeout, printed });
                }
            };
            for byte in bytes {
                if let Some(frame) = self.decoder.push(byte) {
                    self.ready.push_back(frame.and_then(decode_response));
                }
            }
        }
    }

    /// Loads a calibration record and returns the CRC-32 under which the firmware accepted it.
    ///
    /// # Errors
    /// When the firmware refuses it, with the reason, and as for [`Self::ask`].
    pub fn load_calibration(&mut self, record: &[u8]) -> Result<u32, PilError> {
        match self.ask(&Request::LoadCalibration(record))? {
            Response::CalibrationAccepted { crc } => Ok(crc),
            Response::CalibrationRejected(refusal) => Err(PilError::CalibrationRefused(refusal)),
            other => Err(unexpected("load calibration", &other)),
        }
    }

    /// The firmware's counters.
    ///
    /// # Errors
    /// As for [`Self::ask`].
    pub fn status(&mut self) -> Result<Status, PilError> {
        match self.ask(&Request::Status)? {
            Response::Status(status) => Ok(status),
            other => Err(unexpected("status", &other)),
        }
    }

    /// Asks the firmware to end and waits until it has.
    ///
    /// # Errors
    /// As for [`Self::ask`], and when the firmware does not end in time. Its exit code is the caller's to judge.
    pub fn shut_down(mut self) -> Result<Ended, PilError> {
        match self.ask(&Request::Shutdown)? {
            Response::ShuttingDown => {}
            other => return Err(unexpected("shutdown", &other)),
        }
        let code = self.qemu.wait(self.options.timeout)?;
        Ok(Ended { code, log: self.qemu.log(), printed: self.qemu.printed().0 })
    }

    /// Closes the line without a word, as a host does that dies, and waits for the firmware to notice.
    ///
    /// # Errors
    /// When the firmware does not end in time.
    pub fn hang_up(mut self) -> Result<Ended, PilError> {
        // The writing thread ends with its channel, and closes its end of the line.
        self.outgoing = channel().0;
        let code = self.qemu.wait(self.options.timeout)?;
        Ok(Ended { code, log: self.qemu.log(), printed: self.qemu.printed().0 })
    }

    /// Error for a line that has closed: the firmware has ended or is about to.
    fn gone(&mut self) -> PilError {
        match self.qemu.wait(self.options.timeout) {
            Ok(code) => PilError::Ended { code, printed: self.qemu.printed() },
            Err(error) => error,
        }
    }
}

/// Runs a binary that does not talk, such as one that goes wrong on purpose, and returns how it ended.
///
/// # Errors
/// When QEMU or the binary is missing, or does not end in time.
pub fn run_to_end(options: &PilOptions, arguments: &[&str]) -> Result<Ended, PilError> {
    let directory = tempfile::tempdir().map_err(PilError::system("making a working directory for QEMU"))?;
    let mut qemu = Qemu::start(options, arguments, directory.path())?;
    let code = qemu.wait(options.timeout)?;
    Ok(Ended { code, log: qemu.log(), printed: qemu.printed().0 })
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

pub(super) fn unexpected(request: &'static str, answer: &Reply) -> PilError {
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

/// Makes FIFOs with the system's own command: the standard library has no call for it, and this crate no unsafe code.
pub(super) fn make_fifos(paths: &[&Path]) -> Result<(), PilError> {
    let doing = "making the link's FIFOs with `mkfifo` (Linux and macOS have it; on Windows use WSL)";
    let output = Command::new("mkfifo").arg("--").args(paths).output().map_err(PilError::system(doing))?;
    if output.status.success() {
        return Ok(());
    }
    let cause = std::io::Error::other(String::from_utf8_lossy(&output.stderr).trim().to_string());
    Err(PilError::System { doing, cause })
}

pub(super) fn write_in_background(mut to: File) -> Sender<Vec<u8>> {
    let (sender, receiver) = channel::<Vec<u8>>();
    // Ends with the session or with the firmware, whichever is first.
    spawn(move || while receiver.recv().is_ok_and(|bytes| to.write_all(&bytes).is_ok()) {});
    sender
}

pub(super) fn read_in_background(mut from: File) -> Receiver<Vec<u8>> {
    let (sender, receiver) = channel();
    spawn(move || {
        let mut buffer = vec![0; 64 * 1024];
        while let Ok(len @ 1..) = from.read(&mut buffer) {
            let Some(bytes) = buffer.get(..len) else { return };
            if sender.send(bytes.to_vec()).is_err() {
                return;
            }
        }
    });
    receiver
}
