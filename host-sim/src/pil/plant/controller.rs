//! The controller's firmware in QEMU: a message in, a message out, every millisecond.

use std::time::Instant;

use kou_emulation::{
    EmulationStart, FirmwareMessage, FlashDone, MAX_LEN, Order, TickReply, TickReport, pack, unpack,
};

use super::emulated_flash::{EmulatedFlash, FlashOutcome};
use crate::pil::error::PilError;
use crate::pil::options::PilOptions;
use crate::pil::qemu_link::QemuLink;

/// Event of the controller.
// One at a time.
#[allow(clippy::large_enum_variant, reason = "there is one at a time")]
#[derive(Debug)]
pub enum ControllerEvent {
    /// Its next millisecond.
    Tick(TickReport),
    /// Its supply has failed in the middle of a write to flash; nothing more follows.
    NoPower,
}

/// A controller that runs in QEMU. Dropped, QEMU is killed.
pub struct EmulatedController {
    link: QemuLink,
    pending: Vec<u8>,
}

impl EmulatedController {
    /// Starts the firmware.
    ///
    /// # Errors
    /// When QEMU or the firmware is missing or does not start.
    pub fn start(options: &PilOptions, begin: &EmulationStart<'_>) -> Result<Self, PilError> {
        let mut controller = Self { link: QemuLink::start(options, &[])?, pending: Vec::new() };
        controller.send_packed(begin)?;
        Ok(controller)
    }

    /// Waits for the firmware's next millisecond, and serves its flash operations until then.
    ///
    /// # Errors
    /// When the firmware ends or falls silent.
    pub fn receive(&mut self, flash: &mut EmulatedFlash) -> Result<ControllerEvent, PilError> {
        loop {
            match self.next_message()? {
                FirmwareMessage::Tick(message) => return Ok(ControllerEvent::Tick(message)),
                FirmwareMessage::Flash { of, work } => match flash.execute(of, &work) {
                    FlashOutcome::Answer(answer) => self.send_packed::<FlashDone>(&answer)?,
                    FlashOutcome::NoPower => {
                        self.link.kill();
                        return Ok(ControllerEvent::NoPower);
                    }
                },
            }
        }
    }

    fn next_message(&mut self) -> Result<FirmwareMessage, PilError> {
        let since = Instant::now();
        loop {
            if let Some((message, used)) = unpack(&self.pending) {
                self.pending.drain(..used);
                self.link.release_spare_ends();
                return Ok(message);
            }
            let bytes = self.link.receive(since)?;
            self.pending.extend_from_slice(&bytes);
        }
    }

    /// Answers the firmware's millisecond.
    ///
    /// # Errors
    /// When the firmware has ended.
    pub fn send(&mut self, message: &TickReply) -> Result<(), PilError> {
        self.send_packed(message)
    }

    fn send_packed<T: serde::Serialize>(&mut self, message: &T) -> Result<(), PilError> {
        let mut buffer = [0; MAX_LEN];
        self.link.send(pack(message, &mut buffer).unwrap_or_default().to_vec())
    }

    /// Ends the firmware in its next millisecond.
    ///
    /// # Errors
    /// When it does not end as ordered.
    pub fn stop(mut self, flash: &mut EmulatedFlash) -> Result<(), PilError> {
        while !matches!(self.next_message()?, FirmwareMessage::Tick(_)) {
            // The run is over: the write under way is not judged any more, but must not be cut either.
            flash.power_on();
            self.send_packed::<FlashDone>(&None)?;
        }
        self.send(&TickReply {
            spi: heapless::Vec::new(),
            count: 0,
            pump: heapless::Vec::new(),
            motor: heapless::Vec::new(),
            can: heapless::Vec::new(),
            order: Order::Stop,
        })?;
        match self.link.wait()? {
            Some(0) => Ok(()),
            code => Err(PilError::Ended { code, printed: self.link.printed() }),
        }
    }
}
