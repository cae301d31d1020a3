//! A record of samples through the firmware, in batches.

use std::time::Instant;

use kou_estimator::{Estimate, Sample};
use kou_pil::link::{Hello, Request, Response, Status};

use super::error::{ConsoleText, PilError};
use super::options::PilOptions;
use super::session::{BATCH_LEN, PilSession, frame, unexpected};

/// Results of a run through the firmware.
#[derive(Debug, Clone, PartialEq)]
pub struct PilReport {
    /// Samples sent; as many estimates came back.
    pub samples: u64,
    /// Samples per second of real time, from the first sent to the last estimate received.
    pub samples_per_s: f64,
    /// Identification that the firmware sent.
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
/// Whatever ends the run early; estimates handed over before remain valid.
pub fn run(
    options: &PilOptions,
    record: &[u8],
    samples: impl IntoIterator<Item = Sample>,
    mut on_estimate: impl FnMut(u64, &Sample, &Estimate),
) -> Result<PilReport, PilError> {
    let mut session = PilSession::start(options)?;
    session.load_calibration(record)?;
    let begin = Instant::now();
    let mut done: u64 = 0;
    let mut batch = SampleBatch::default();
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
    let exit = session.shut_down()?;
    match exit.code {
        Some(0) => Ok(PilReport { samples, samples_per_s, hello, status, log: exit.log }),
        code => Err(PilError::Ended { code, printed: ConsoleText(exit.printed) }),
    }
}

/// Samples that go over the line in one write and into the firmware in one read.
#[derive(Default)]
struct SampleBatch {
    bytes: Vec<u8>,
    samples: Vec<Sample>,
}

impl SampleBatch {
    /// Sends the batch, waits for all its estimates, and returns the number of samples done.
    fn exchange(
        &mut self,
        session: &mut PilSession,
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
                Ok(other) => return Err(unexpected("sample", &other)),
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
