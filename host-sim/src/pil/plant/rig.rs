//! The line to the controller's firmware in QEMU: a message in, a message out, every millisecond.

use std::fs::{File, OpenOptions};
use std::path::Path;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender};
use std::time::{Duration, Instant};

use kou_emulation::{
    EmulationStart, FirmwareMessage, FlashDone, MAX_LEN, Order, TickReply, TickReport, pack, unpack,
};
use tempfile::TempDir;

use super::super::qemu::Qemu;
use super::super::session::{make_fifos, read_in_background, write_in_background};
use super::super::{PilError, PilOptions, Printed};
use super::flash::{Done, Flash};

/// How often a wait looks whether QEMU still runs.
const GLANCE: Duration = Duration::from_millis(100);

/// What the firmware comes with.
// One at a time.
#[allow(clippy::large_enum_variant, reason = "there is one at a time")]
#[derive(Debug)]
pub enum Heard {
    /// Its next millisecond.
    Tick(TickReport),
    /// Nothing more: its supply has failed in the middle of a write to flash.
    NoPower,
}

/// A controller that runs. Dropped, it is ended the hard way.
pub struct Rig {
    // Declared first and so dropped first: the FIFOs' directory goes after QEMU.
    qemu: Qemu,
    outgoing: Sender<Vec<u8>>,
    incoming: Receiver<Vec<u8>>,
    pending: Vec<u8>,
    timeout: Duration,
    keep: Option<(File, File)>,
    _directory: TempDir,
}

impl Rig {
    /// Starts the firmware.
    ///
    /// # Errors
    /// When QEMU or the firmware is missing or does not start.
    pub fn start(options: &PilOptions, begin: &EmulationStart<'_>) -> Result<Self, PilError> {
        let doing = PilError::system;
        let directory = tempfile::Builder::new()
            .prefix("kou-rig-")
            .tempdir()
            .map_err(doing("making a directory for the rig's FIFOs"))?;
        let (from_host, to_host) =
            (directory.path().join("kou-link.in"), directory.path().join("kou-link.out"));
        make_fifos(&[&from_host, &to_host])?;
        // Opened for both directions a FIFO opens at once, and while these are open, so do all other ends.
        let both = |path: &Path| {
            OpenOptions::new().read(true).write(true).open(path).map_err(doing("opening the rig's FIFOs"))
        };
        let keep = (both(&from_host)?, both(&to_host)?);
        let writer = OpenOptions::new().write(true).open(&from_host);
        let writer = writer.map_err(doing("opening the rig's FIFOs"))?;
        let reader = File::open(&to_host).map_err(doing("opening the rig's FIFOs"))?;
        let rig = Self {
            qemu: Qemu::start(options, &[], directory.path())?,
            outgoing: write_in_background(writer),
            incoming: read_in_background(reader),
            pending: Vec::new(),
            timeout: options.timeout,
            keep: Some(keep),
            _directory: directory,
        };
        let mut buffer = [0; MAX_LEN];
        let bytes = pack(begin, &mut buffer).unwrap_or_default().to_vec();
        if rig.outgoing.send(bytes).is_err() {
            return Err(PilError::Ended { code: None, printed: Printed::default() });
        }
        Ok(rig)
    }

    /// Waits for the firmware's next millisecond, and does what it asks of its flash until then.
    ///
    /// # Errors
    /// When the firmware ends or falls silent.
    pub fn receive(&mut self, flash: &mut Flash) -> Result<Heard, PilError> {
        loop {
            match self.said()? {
                FirmwareMessage::Tick(message) => return Ok(Heard::Tick(message)),
                FirmwareMessage::Flash { of, work } => match flash.work(of, &work) {
                    Done::Answer(answer) => self.answer::<FlashDone>(&answer)?,
                    Done::NoPower => {
                        self.qemu.kill();
                        return Ok(Heard::NoPower);
                    }
                },
            }
        }
    }

    fn said(&mut self) -> Result<FirmwareMessage, PilError> {
        let start = Instant::now();
        loop {
            if let Some((message, used)) = unpack(&self.pending) {
                self.pending.drain(..used);
                // From here on the firmware alone holds the other ends, so its end is seen as the end of the line.
                self.keep = None;
                return Ok(message);
            }
            match self.incoming.recv_timeout(GLANCE) {
                Ok(bytes) => self.pending.extend_from_slice(&bytes),
                Err(RecvTimeoutError::Disconnected) => return Err(self.gone()),
                Err(RecvTimeoutError::Timeout) if self.qemu.has_ended() => return Err(self.gone()),
                Err(RecvTimeoutError::Timeout) if start.elapsed() < self.timeout => {}
                Err(RecvTimeoutError::Timeout) => {
                    self.qemu.kill();
                    return Err(PilError::Timeout { after: self.timeout, printed: self.qemu.printed() });
                }
            }
        }
    }

    /// Answers the firmware's millisecond.
    ///
    /// # Errors
    /// When the firmware has ended.
    pub fn send(&mut self, message: &TickReply) -> Result<(), PilError> {
        self.answer(message)
    }

    fn answer<T: serde::Serialize>(&mut self, message: &T) -> Result<(), PilError> {
        let mut buffer = [0; MAX_LEN];
        let bytes = pack(message, &mut buffer).unwrap_or_default().to_vec();
        if self.outgoing.send(bytes).is_ok() { Ok(()) } else { Err(self.gone()) }
    }

    /// Ends the firmware in its next millisecond.
    ///
    /// # Errors
    /// When it does not end as it was told.
    pub fn stop(mut self, flash: &mut Flash) -> Result<(), PilError> {
        while !matches!(self.said()?, FirmwareMessage::Tick(_)) {
            // The run is over: what it was about to write is not judged any more, but must not be cut either.
            flash.power_on();
            self.answer::<FlashDone>(&None)?;
        }
        self.send(&TickReply {
            spi: heapless::Vec::new(),
            count: 0,
            pump: heapless::Vec::new(),
            motor: heapless::Vec::new(),
            can: heapless::Vec::new(),
            order: Order::Stop,
        })?;
        match self.qemu.wait(self.timeout)? {
            Some(0) => Ok(()),
            code => Err(PilError::Ended { code, printed: self.qemu.printed() }),
        }
    }

    fn gone(&mut self) -> PilError {
        match self.qemu.wait(self.timeout) {
            Ok(code) => PilError::Ended { code, printed: self.qemu.printed() },
            Err(error) => error,
        }
    }
}
