//! Processor in the loop: samples through the firmware in QEMU, estimates back.
//!
//! [`run`] does a whole record; [`Session`] is the conversation below it, which also lets a test put arbitrary bytes on
//! the line. The exchange is in lockstep, a batch of samples out and their estimates back, so that a run gives the same
//! bits and the same firmware time again. QEMU is killed on every way out, and no wait is without a limit.
//!
//! Needs a system with FIFOs: Linux, macOS, or Windows through WSL.

mod error;
pub mod plant;
mod qemu;
mod session;

use std::path::PathBuf;
use std::time::{Duration, Instant};

use kou_estimator::{Estimate, Sample};
use kou_pil::link::{Hello, Request, Response, Status};

pub use error::{BUILD_FIRMWARE, INSTALL_QEMU, PilError, Printed};
pub use session::{BATCH_LEN, Ended, Reply, Session, frame, run_to_end};

/// What carries the link's bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Line {
    /// Files reached by semihosting: fast, and in lockstep.
    #[default]
    Files,
    /// The board's UART: slow, as on hardware, and bytes arrive whenever they arrive.
    Uart,
}

impl Line {
    /// The firmware's command line that makes it use this line.
    fn arguments(self) -> &'static [&'static str] {
        match self {
            Self::Files => &[],
            Self::Uart => &["kou", "uart"],
        }
    }
}

/// What to run, and with what patience.
#[derive(Debug, Clone)]
pub struct PilOptions {
    /// The firmware.
    pub firmware_elf: PathBuf,
    /// QEMU's program; a bare name is looked up in the path.
    pub qemu: PathBuf,
    /// Longest time for which the firmware may be silent.
    pub timeout: Duration,
    /// Whether the firmware's clock counts instructions, and so is the same in every run. Off, QEMU is faster.
    pub deterministic: bool,
    /// What carries the link's bytes.
    pub line: Line,
}

impl Default for PilOptions {
    fn default() -> Self {
        Self {
            firmware_elf: qemu::find_firmware(),
            qemu: "qemu-system-arm".into(),
            timeout: Duration::from_secs(60),
            deterministic: true,
            line: Line::Files,
        }
    }
}

impl PilOptions {
    /// Options for the board's binary `name` instead of the firmware.
    #[must_use]
    pub fn of_binary(name: &str) -> Self {
        Self { firmware_elf: qemu::find_binary(name), ..Self::default() }
    }
}

/// What a run through the firmware came to.
#[derive(Debug, Clone, PartialEq)]
pub struct PilReport {
    /// Samples sent; as many estimates came back.
    pub samples: u64,
    /// Samples per second of real time, from the first sent to the last estimate received.
    pub samples_per_s: f64,
    /// What the firmware said of itself.
    pub hello: Hello<String>,
    /// The firmware's counters and stack depth at the end of the run.
    pub status: Status,
    /// The firmware's log, encoded by defmt: `defmt-print -e FIRMWARE` makes text of it.
    pub log: Vec<u8>,
}

/// Sends a calibration record and then every sample to the firmware; hands over each estimate, in order, with the
/// number of its sample and the sample itself.
///
/// # Errors
/// Whatever keeps the run from its end; estimates handed over before that stand.
pub fn run(
    options: &PilOptions,
    record: &[u8],
    samples: impl IntoIterator<Item = Sample>,
    mut on_estimate: impl FnMut(u64, &Sample, &Estimate),
) -> Result<PilReport, PilError> {
    let mut session = Session::start(options)?;
    session.load_calibration(record)?;
    let begin = Instant::now();
    let mut done: u64 = 0;
    let mut batch = Batch::default();
    for sample in samples {
        let bytes = frame(&Request::Sample(sample))?;
        if batch.bytes.len() + bytes.len() > BATCH_LEN {
            done = batch.exchange(&mut session, done, &mut on_estimate)?;
        }
        batch.bytes.extend_from_slice(&bytes);
        batch.samples.push(sample);
    }
    let samples = batch.exchange(&mut session, done, &mut on_estimate)?;
    let samples_per_s = samples as f64 / begin.elapsed().as_secs_f64().max(f64::MIN_POSITIVE);
    let status = session.status()?;
    let hello = session.hello().clone();
    let ended = session.shut_down()?;
    match ended.code {
        Some(0) => Ok(PilReport { samples, samples_per_s, hello, status, log: ended.log }),
        code => Err(PilError::Ended { code, printed: Printed(ended.printed) }),
    }
}

/// Samples that go over the line in one write and into the firmware in one read.
#[derive(Default)]
struct Batch {
    bytes: Vec<u8>,
    samples: Vec<Sample>,
}

impl Batch {
    /// Sends the batch, waits for all its estimates, and returns the number of samples done.
    fn exchange(
        &mut self,
        session: &mut Session,
        mut done: u64,
        on_estimate: &mut impl FnMut(u64, &Sample, &Estimate),
    ) -> Result<u64, PilError> {
        if self.samples.is_empty() {
            return Ok(done);
        }
        session.send_raw(std::mem::take(&mut self.bytes))?;
        for sample in self.samples.drain(..) {
            match session.receive()? {
                Ok(Response::Estimate(estimate)) => on_estimate(done, &sample, &estimate),
                Ok(other) => return Err(session::unexpected("sample", &other)),
                Err(error) => {
                    return Err(PilError::Unexpected { request: "sample", answer: error.to_string() });
                }
            }
            done += 1;
        }
        Ok(done)
    }
}

/// Whether two estimates are the same in every field, bit for bit: zeros of different sign differ, and NaN equals the
/// same NaN.
#[must_use]
pub fn same_bits(a: &Estimate, b: &Estimate) -> bool {
    let bytes = |estimate: &Estimate| {
        let mut buffer = [0; 128];
        postcard::to_slice(estimate, &mut buffer).map(|bytes| bytes.to_vec())
    };
    matches!((bytes(a), bytes(b)), (Ok(a), Ok(b)) if a == b)
}
