//! Line of the PIL link over UART 0, as on a board without semihosting.
//!
//! An interrupt moves received bytes into a pipe, from which the task `link in` reads. While the pipe is full the
//! interrupt is disabled and the byte remains in the UART: QEMU then blocks the sender; real hardware would lose
//! bytes, which the frame's CRC detects. Sending is polled, yielding to the other tasks in between.

use embassy_futures::yield_now;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::pipe::Pipe;
use embedded_io_async::{ErrorKind, ErrorType, Read, Write};

use crate::interrupts::{Interrupt, unmask};
use crate::registers::{read, write};

const UART0: usize = 0x4000_4000;
/// Offsets of a CMSDK UART's registers.
const DATA: usize = 0x0;
const STATE: usize = 0x4;
const CTRL: usize = 0x8;
const INTERRUPT: usize = 0xC;
const BAUD_DIVIDER: usize = 0x10;
/// Bits of STATE.
const SEND_FULL: u32 = 1 << 0;
const RECEIVE_FULL: u32 = 1 << 1;
/// Bits of CTRL: send, receive, and the interrupt on receipt.
const ENABLE: u32 = 0b11;
const RECEIVE_INTERRUPT: u32 = 1 << 3;
/// Bit of INTERRUPT.
const RECEIVED: u32 = 1 << 1;

/// 25 MHz over this is 1 562 500 baud.
const DIVIDER: u32 = 16;

static RECEIVED_BYTES: Pipe<CriticalSectionRawMutex, 1024> = Pipe::new();

/// Receiving half of the UART.
pub struct UartReceiver(());

/// Sending half of the UART.
pub struct UartSender(());

/// Starts the UART.
#[must_use]
pub fn open() -> (UartReceiver, UartSender) {
    write(UART0 + BAUD_DIVIDER, DIVIDER);
    write(UART0 + CTRL, ENABLE | RECEIVE_INTERRUPT);
    unmask(Interrupt::Uart0Receive);
    (UartReceiver(()), UartSender(()))
}

/// Interrupt on receipt.
pub(crate) extern "C" fn on_receive() {
    write(UART0 + INTERRUPT, RECEIVED);
    while read(UART0 + STATE) & RECEIVE_FULL != 0 {
        if RECEIVED_BYTES.is_full() {
            write(UART0 + CTRL, ENABLE);
            return;
        }
        // Only the low byte is data.
        let [byte, ..] = read(UART0 + DATA).to_le_bytes();
        // There is room and nobody else writes, so this takes the byte.
        if RECEIVED_BYTES.try_write(&[byte]).is_err() {
            return;
        }
    }
}

impl ErrorType for UartReceiver {
    type Error = ErrorKind;
}

impl Read for UartReceiver {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, ErrorKind> {
        let received = RECEIVED_BYTES.read(buffer).await;
        if read(UART0 + CTRL) & RECEIVE_INTERRUPT == 0 {
            write(UART0 + CTRL, ENABLE | RECEIVE_INTERRUPT);
            // A byte that arrived meanwhile has had its interrupt already.
            critical_section::with(|_| on_receive());
        }
        Ok(received)
    }
}

impl ErrorType for UartSender {
    type Error = ErrorKind;
}

impl Write for UartSender {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, ErrorKind> {
        for &byte in bytes {
            while read(UART0 + STATE) & SEND_FULL != 0 {
                yield_now().await;
            }
            write(UART0 + DATA, u32::from(byte));
        }
        Ok(bytes.len())
    }

    async fn flush(&mut self) -> Result<(), ErrorKind> {
        while read(UART0 + STATE) & SEND_FULL != 0 {
            yield_now().await;
        }
        Ok(())
    }
}
