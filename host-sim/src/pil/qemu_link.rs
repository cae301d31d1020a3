//! The firmware in QEMU with a link of bytes to it, and a limit on every wait.
//!
//! The link is a pair of FIFOs in a temporary directory. Opening, reading and writing a FIFO can block for ever, so threads
//! do all three and this side only waits on channels, with a limit. When QEMU ends, its ends of the FIFOs close, and both
//! threads end with them.

use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::path::Path;
use std::process::Command;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::spawn;
use std::time::{Duration, Instant};

use tempfile::TempDir;

use super::error::{ConsoleText, PilError};
use super::options::PilOptions;
use super::qemu::Qemu;

/// Interval at which a wait checks that QEMU still runs.
const POLL_INTERVAL: Duration = Duration::from_millis(100);

/// Names of the FIFOs, known to the firmware; without their endings, to QEMU's UART.
const TO_FIRMWARE: &str = "kou-link.in";
const FROM_FIRMWARE: &str = "kou-link.out";

/// A running firmware and the link to it. Dropped, QEMU is killed.
pub(super) struct QemuLink {
    // Declared first and so dropped first: the FIFOs' directory goes after QEMU.
    qemu: Qemu,
    outgoing: Sender<Vec<u8>>,
    incoming: Receiver<Vec<u8>>,
    /// The host's own other ends, until the firmware has opened its ends.
    spare_ends: Option<(File, File)>,
    timeout: Duration,
    _directory: TempDir,
}

impl QemuLink {
    /// Makes the FIFOs and starts the firmware with `arguments` as its command line.
    ///
    /// # Errors
    /// When QEMU or the firmware is missing or does not start.
    pub(super) fn start(options: &PilOptions, arguments: &[&str]) -> Result<Self, PilError> {
        let doing = PilError::system;
        let directory = tempfile::Builder::new()
            .prefix("kou-pil-")
            .tempdir()
            .map_err(doing("making a directory for the link's FIFOs"))?;
        let (to, from) = (directory.path().join(TO_FIRMWARE), directory.path().join(FROM_FIRMWARE));
        make_fifos(&[&to, &from])?;
        // Opened for both directions a FIFO opens at once, and while these are open, so do all other ends.
        let both = |path: &Path| {
            OpenOptions::new().read(true).write(true).open(path).map_err(doing("opening the link's FIFOs"))
        };
        let spare_ends = (both(&to)?, both(&from)?);
        let writer = OpenOptions::new().write(true).open(&to);
        let writer = writer.map_err(doing("opening the link's FIFO to the firmware"))?;
        let reader = File::open(&from).map_err(doing("opening the link's FIFO from the firmware"))?;
        Ok(Self {
            qemu: Qemu::start(options, arguments, directory.path())?,
            outgoing: write_in_background(writer),
            incoming: read_in_background(reader),
            spare_ends: Some(spare_ends),
            timeout: options.timeout,
            _directory: directory,
        })
    }

    /// Leaves the other ends to the firmware alone, so that its end closes the link. To be called after its first message.
    pub(super) fn release_spare_ends(&mut self) {
        self.spare_ends = None;
    }

    /// Sends bytes.
    ///
    /// # Errors
    /// When the firmware has ended.
    pub(super) fn send(&mut self, bytes: Vec<u8>) -> Result<(), PilError> {
        if self.outgoing.send(bytes).is_ok() { Ok(()) } else { Err(self.ended()) }
    }

    /// Waits for bytes, until the timeout after `since`.
    ///
    /// # Errors
    /// When the firmware ends or falls silent.
    pub(super) fn receive(&mut self, since: Instant) -> Result<Vec<u8>, PilError> {
        loop {
            match self.incoming.recv_timeout(POLL_INTERVAL) {
                Ok(bytes) => return Ok(bytes),
                Err(RecvTimeoutError::Disconnected) => return Err(self.ended()),
                // A firmware that ends before its first message leaves no trace on the link, so QEMU is checked, too.
                Err(RecvTimeoutError::Timeout) if self.qemu.has_ended() => return Err(self.ended()),
                Err(RecvTimeoutError::Timeout) if since.elapsed() < self.timeout => {}
                Err(RecvTimeoutError::Timeout) => {
                    self.qemu.kill();
                    return Err(PilError::Timeout { after: self.timeout, printed: self.qemu.printed() });
                }
            }
        }
    }

    /// Closes the link without a message, as a host does that dies.
    pub(super) fn close(&mut self) {
        // The writing thread ends with its channel, and closes its end.
        self.outgoing = channel().0;
    }

    /// Kills QEMU.
    pub(super) fn kill(&mut self) {
        self.qemu.kill();
    }

    /// Waits for QEMU to end and returns its exit code.
    ///
    /// # Errors
    /// When it does not end in time.
    pub(super) fn wait(&mut self) -> Result<Option<i32>, PilError> {
        self.qemu.wait(self.timeout)
    }

    /// The firmware's log, after its end.
    pub(super) fn log(&mut self) -> Vec<u8> {
        self.qemu.log()
    }

    /// Text output of the firmware, after its end.
    pub(super) fn printed(&mut self) -> ConsoleText {
        self.qemu.printed()
    }

    /// Error of a link that has closed: the firmware has ended or is about to.
    fn ended(&mut self) -> PilError {
        match self.wait() {
            Ok(code) => PilError::Ended { code, printed: self.qemu.printed() },
            Err(error) => error,
        }
    }
}

/// Makes FIFOs with the system's own command: the standard library has no call for it, and this crate no unsafe code.
fn make_fifos(paths: &[&Path]) -> Result<(), PilError> {
    let doing = "making the link's FIFOs with `mkfifo` (Linux and macOS have it; on Windows use WSL)";
    let output = Command::new("mkfifo").arg("--").args(paths).output().map_err(PilError::system(doing))?;
    if output.status.success() {
        return Ok(());
    }
    let cause = std::io::Error::other(String::from_utf8_lossy(&output.stderr).trim().to_string());
    Err(PilError::System { doing, cause })
}

fn write_in_background(mut to: File) -> Sender<Vec<u8>> {
    let (sender, receiver) = channel::<Vec<u8>>();
    // Ends with the session or with the firmware, whichever is first.
    spawn(move || while receiver.recv().is_ok_and(|bytes| to.write_all(&bytes).is_ok()) {});
    sender
}

fn read_in_background(mut from: File) -> Receiver<Vec<u8>> {
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
