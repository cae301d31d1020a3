//! One QEMU process: started, supervised, and killed on every way out.

use std::io::{ErrorKind, Read};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::{JoinHandle, sleep, spawn};
use std::time::{Duration, Instant};

use super::error::{ConsoleText, PilError};
use super::options::{LinkTransport, PilOptions};

/// Largest length of the firmware's log, bytes; it logs transitions, so a real log is far shorter.
const MAX_LOG: u64 = 4 << 20;

/// A running QEMU. Dropped, it is killed.
pub(super) struct Qemu {
    child: Child,
    log: Option<JoinHandle<Vec<u8>>>,
    printed: Option<JoinHandle<Vec<u8>>>,
}

impl Qemu {
    /// Starts the firmware, with `arguments` as its command line and `directory` as the place of its files.
    pub(super) fn start(
        options: &PilOptions,
        arguments: &[&str],
        directory: &Path,
    ) -> Result<Self, PilError> {
        let elf = &options.firmware_elf;
        let elf = elf.canonicalize().map_err(|_| PilError::FirmwareMissing { path: elf.clone() })?;
        let mut command = Command::new(&options.qemu);
        command.args(["-machine", "mps2-an386", "-display", "none", "-monitor", "none"]);
        // QEMU adds the endings .in and .out to the pipe's name.
        command.args([
            "-serial",
            if options.transport == LinkTransport::Uart { "pipe:kou-link" } else { "none" },
        ]);
        if options.deterministic {
            command.args(["-icount", "shift=5,sleep=off"]);
        }
        let mut semihosting = String::from("enable=on,target=native");
        for argument in arguments {
            semihosting.push_str(",arg=");
            semihosting.push_str(argument);
        }
        command.args(["-semihosting-config", &semihosting]).arg("-kernel").arg(&elf);
        command.current_dir(directory).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().map_err(|cause| match cause.kind() {
            ErrorKind::NotFound => {
                PilError::QemuMissing { program: options.qemu.to_string_lossy().into_owned() }
            }
            _ => PilError::System { doing: "starting QEMU", cause },
        })?;
        let log = child.stdout.take().map(collect);
        let printed = child.stderr.take().map(collect);
        Ok(Self { child, log, printed })
    }

    /// Waits for QEMU to end by itself and returns its exit code.
    pub(super) fn wait(&mut self, limit: Duration) -> Result<Option<i32>, PilError> {
        let start = Instant::now();
        let mut pause = Duration::from_micros(200);
        loop {
            if let Some(status) = self.child.try_wait().map_err(PilError::system("waiting for QEMU"))? {
                return Ok(status.code());
            }
            if start.elapsed() >= limit {
                self.kill();
                return Err(PilError::Timeout { after: limit, printed: self.printed() });
            }
            sleep(pause);
            pause = (pause * 2).min(Duration::from_millis(20));
        }
    }

    /// Whether QEMU has ended.
    pub(super) fn has_ended(&mut self) -> bool {
        !matches!(self.child.try_wait(), Ok(None))
    }

    /// Ends QEMU at once; does nothing when it has ended.
    pub(super) fn kill(&mut self) {
        // Both fail only when there is no such process any more.
        drop(self.child.kill());
        drop(self.child.wait());
    }

    /// The firmware's log as defmt wrote it, once. Call it after the end: it waits for it.
    pub(super) fn log(&mut self) -> Vec<u8> {
        self.log.take().and_then(|thread| thread.join().ok()).unwrap_or_default()
    }

    /// Text output of firmware and QEMU, once. Waits for their end.
    pub(super) fn printed(&mut self) -> ConsoleText {
        let bytes = self.printed.take().and_then(|thread| thread.join().ok()).unwrap_or_default();
        ConsoleText(String::from_utf8_lossy(&bytes).into_owned())
    }
}

impl Drop for Qemu {
    fn drop(&mut self) {
        self.kill();
    }
}

/// Collects what is written, up to a limit, and reads on beyond it, so that the writer never blocks.
fn collect(mut from: impl Read + Send + 'static) -> JoinHandle<Vec<u8>> {
    spawn(move || {
        let mut collected = Vec::new();
        // A failing pipe ends the log; the exit code shows the cause.
        drop(from.by_ref().take(MAX_LOG).read_to_end(&mut collected));
        drop(std::io::copy(&mut from, &mut std::io::sink()));
        collected
    })
}
