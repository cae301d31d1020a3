//! Task `estimate`: answers commands one by one and in order. The only task that owns parameters and state.

use embassy_sync::blocking_mutex::raw::RawMutex;
use kou_estimator::record;
use kou_estimator::{Params, Sample, State, step};

use super::board::Board;
use super::channels::{ServerChannels, ServerCommand, ServerResponse};
use crate::link::{ErrorKind, Hello, PROTOCOL, Response, Status};
use crate::log::log;

/// Calibration in use.
struct Active {
    crc: u32,
    params: Params,
    state: State,
}

/// Runs the estimating task; never returns.
pub async fn run_estimate<M: RawMutex, B: Board>(channels: &ServerChannels<M>, board: &B) -> ! {
    let mut active: Option<Active> = None;
    loop {
        let answer = match channels.commands.receive().await {
            ServerCommand::Hello => Response::Hello(Hello {
                protocol: PROTOCOL,
                record_schema: record::calibration::SCHEMA,
                version: env!("CARGO_PKG_VERSION"),
                board: B::NAME,
            }),
            ServerCommand::Adopt { crc } => {
                let params = channels.candidate.receive().await;
                // Activated between two samples. The state belongs to the previous calibration and is discarded with
                // it.
                active = Some(Active { crc, params, state: State::new() });
                log!(info, "calibration {=u32:08x} in use", crc);
                Response::CalibrationAccepted { crc }
            }
            ServerCommand::Reject(rejection) => Response::CalibrationRejected(rejection),
            ServerCommand::Sample(sample) => estimate(channels, active.as_mut(), &sample),
            ServerCommand::Status => Response::Status(Status {
                uptime_us: board.uptime_us(),
                stack_high_water_bytes: board.stack_high_water_bytes(),
                calibration: active.as_ref().map(|active| active.crc),
                counts: channels.counters.read(),
            }),
            ServerCommand::ReportError(kind) => Response::Error(kind),
            ServerCommand::Shutdown => Response::ShuttingDown,
        };
        channels.responses.send(answer).await;
    }
}

fn estimate<M: RawMutex>(
    channels: &ServerChannels<M>,
    active: Option<&mut Active>,
    sample: &Sample,
) -> ServerResponse {
    let Some(active) = active else {
        channels.counters.samples_without_calibration.increment();
        return Response::Error(ErrorKind::NoCalibration);
    };
    let estimate = step(&active.params, &mut active.state, sample);
    if estimate.expected.is_ok() && estimate.observed.is_ok() {
        channels.counters.estimates_valid.increment();
    } else {
        channels.counters.estimates_rejected.increment();
    }
    Response::Estimate(estimate)
}
