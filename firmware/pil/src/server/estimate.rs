//! Task `estimate`: commands into responses, one for one and in order. The only task that holds parameters and state.

use embassy_sync::blocking_mutex::raw::RawMutex;
use kou_estimator::calibration::record;
use kou_estimator::{Params, Sample, State, step};

use super::board::Board;
use super::channels::{ServerChannels, ServerCommand, ServerResponse};
use crate::link::{ErrorKind, Hello, PROTOCOL, Response, Status};
use crate::log::log;

/// A calibration in use.
struct Active {
    crc: u32,
    params: Params,
    state: State,
}

/// Answers commands for ever.
pub async fn run_estimate<M: RawMutex, B: Board>(bus: &ServerChannels<M>, board: &B) -> ! {
    let mut active: Option<Active> = None;
    loop {
        let answer = match bus.commands.receive().await {
            ServerCommand::Hello => Response::Hello(Hello {
                protocol: PROTOCOL,
                record_schema: record::SCHEMA,
                version: env!("CARGO_PKG_VERSION"),
                board: B::NAME,
            }),
            ServerCommand::Adopt { crc } => {
                let params = bus.candidate.receive().await;
                // Swapped between two samples, whole. The state belongs to the old calibration and goes with it.
                active = Some(Active { crc, params, state: State::new() });
                log!(info, "calibration {=u32:08x} in use", crc);
                Response::CalibrationAccepted { crc }
            }
            ServerCommand::Reject(rejection) => Response::CalibrationRejected(rejection),
            ServerCommand::Sample(sample) => estimate(bus, active.as_mut(), &sample),
            ServerCommand::Status => Response::Status(Status {
                uptime_us: board.uptime_us(),
                stack_high_water_bytes: board.stack_high_water_bytes(),
                calibration: active.as_ref().map(|active| active.crc),
                counts: bus.counters.read(),
            }),
            ServerCommand::ReportError(kind) => Response::Error(kind),
            ServerCommand::Shutdown => Response::ShuttingDown,
        };
        bus.responses.send(answer).await;
    }
}

fn estimate<M: RawMutex>(
    bus: &ServerChannels<M>,
    active: Option<&mut Active>,
    sample: &Sample,
) -> ServerResponse {
    let Some(active) = active else {
        bus.counters.samples_without_calibration.increment();
        return Response::Error(ErrorKind::NoCalibration);
    };
    let estimate = step(&active.params, &mut active.state, sample);
    if estimate.expected.is_ok() && estimate.seen.is_ok() {
        bus.counters.estimates_valid.increment();
    } else {
        bus.counters.estimates_rejected.increment();
    }
    Response::Estimate(estimate)
}
