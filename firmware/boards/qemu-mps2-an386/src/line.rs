//! Line of the PIL link in QEMU: two files of the host, accessed by semihosting.
//!
//! The host creates a pair of FIFOs with fixed names in QEMU's working directory. A read stops the whole emulated
//! processor until bytes arrive, so it waits until every request has been answered. The exchange is therefore in
//! lockstep: with QEMU's `-icount` the firmware's time is independent of the host's speed. A read of zero bytes means
//! that the host has closed its end.

use core::ffi::CStr;

use embassy_sync::blocking_mutex::raw::RawMutex;
use embedded_io_async::{ErrorKind, ErrorType, Read, Write};
use kou_pil::server::InFlight;
use semihosting::fs::File;
use semihosting::io::{self, Read as _, Write as _};

/// Name of the file with the requests.
pub const REQUESTS: &CStr = c"kou-link.in";
/// Name of the file for the responses.
pub const RESPONSES: &CStr = c"kou-link.out";

/// Receiving end of the line.
pub struct Requests<M: RawMutex + 'static> {
    file: File,
    in_flight: &'static InFlight<M>,
}

/// Sending end of the line.
pub struct Responses {
    file: File,
}

/// Opens the line, requests first: the host opens its ends in the same order.
///
/// # Errors
/// The files do not exist: no host is present.
pub fn open<M: RawMutex>(in_flight: &'static InFlight<M>) -> io::Result<(Requests<M>, Responses)> {
    let requests = Requests { file: File::open(REQUESTS)?, in_flight };
    let responses = Responses { file: File::create(RESPONSES)? };
    Ok((requests, responses))
}

impl<M: RawMutex> ErrorType for Requests<M> {
    type Error = ErrorKind;
}

impl<M: RawMutex> Read for Requests<M> {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, ErrorKind> {
        self.in_flight.wait_idle().await;
        self.file.read(buffer).map_err(|_| ErrorKind::Other)
    }
}

impl ErrorType for Responses {
    type Error = ErrorKind;
}

impl Write for Responses {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, ErrorKind> {
        self.file.write(bytes).map_err(|_| ErrorKind::Other)
    }

    async fn flush(&mut self) -> Result<(), ErrorKind> {
        Ok(())
    }
}
