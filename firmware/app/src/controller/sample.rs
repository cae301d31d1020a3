//! Task `sample`: reads the front end each millisecond, and assembles a sample for every cycle of `estimate`.

use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::Instant;

use super::periodic::{Ticker, now};
use super::periods::{ESTIMATE_PERIOD, SAMPLE_PERIOD};
use super::shared::Controller;
use crate::log::warning;
use crate::sensors::adc::{Adc, Input};
use crate::sensors::pickup::Edges;
use crate::sensors::set::{CHANNELS, SensorInputs, SensorsParams, SensorsState};

/// Front end: all inputs to which a drive's sensors are connected.
#[allow(async_fn_in_trait, reason = "called by tasks that are not sent between threads")]
pub trait FrontEnd {
    /// Reads a conversion of each wanted input, and the edges since the last call.
    async fn read(&mut self, wanted: &[Option<Input>; CHANNELS], into: &mut SensorInputs);
}

/// Timer that stamps the edges of the pickups.
pub trait EdgeTimer {
    /// Hands over the edges since the last call, and returns the timer's present count.
    fn take(&mut self, pump: &mut Edges, motor: &mut Edges) -> u32;
}

/// Default front end: an analogue-to-digital converter and a timer.
#[derive(Debug)]
pub struct AdcSampler<A, T> {
    adc: A,
    timer: T,
}

impl<A: Adc, T: EdgeTimer> AdcSampler<A, T> {
    /// Combines the two.
    pub const fn new(adc: A, timer: T) -> Self {
        Self { adc, timer }
    }
}

impl<A: Adc, T: EdgeTimer> FrontEnd for AdcSampler<A, T> {
    async fn read(&mut self, wanted: &[Option<Input>; CHANNELS], into: &mut SensorInputs) {
        // Edges first: they are stamped already, whereas conversions take time.
        into.pump.clear();
        into.motor.clear();
        into.count = self.timer.take(&mut into.pump, &mut into.motor);
        for (conversion, input) in into.analog.iter_mut().zip(wanted) {
            if let Some(input) = input {
                *conversion = self.adc.convert(*input).await;
            }
        }
    }
}

/// Working data of the task. Outside the task, because a task is moved when it is started.
#[derive(Debug)]
pub struct SensorsMemory {
    state: SensorsState,
    inputs: SensorInputs,
}

impl SensorsMemory {
    /// Before the first millisecond.
    #[must_use]
    pub const fn new() -> Self {
        Self { state: SensorsState::new(), inputs: SensorInputs::new() }
    }
}

impl Default for SensorsMemory {
    fn default() -> Self {
        Self::new()
    }
}

/// Cycles of this task per cycle of `estimate`.
const CYCLES: u64 = ESTIMATE_PERIOD.as_ticks() / SAMPLE_PERIOD.as_ticks();

/// Runs the sampling task; never returns.
pub async fn run_sample<M: RawMutex>(
    controller: &Controller<M>,
    start: Instant,
    params: &SensorsParams,
    front_end: &mut impl FrontEnd,
    memory: &mut SensorsMemory,
) -> ! {
    let mut ticker = Ticker::new(start, SAMPLE_PERIOD, &controller.task_stats.sample);
    let SensorsMemory { state, inputs } = memory;
    let mut cycle: u64 = 0;
    let mut faulty = false;
    loop {
        ticker.cycle().await;
        front_end.read(params.inputs(), inputs).await;
        state.observe(params, now(), inputs);
        cycle = cycle.wrapping_add(1);
        if cycle.is_multiple_of(CYCLES) {
            let faults = publish_sample(controller, params, state);
            if faults != faulty {
                // The fault code is logged when it is recorded.
                warning!("sensors failed: {=bool}", faults);
                faulty = faults;
            }
        }
    }
}

/// Publishes the sample for `estimate`; returns whether a required sensor has failed.
// Not inlined: a sample would otherwise occupy the task's memory permanently.
#[inline(never)]
fn publish_sample<M: RawMutex>(
    controller: &Controller<M>,
    params: &SensorsParams,
    state: &mut SensorsState,
) -> bool {
    let sample = state.sample(params, &controller.external_oil_temperature());
    controller.set_sample(sample);
    sample.pump_speed.value.is_err()
        || sample.motor_speed.value.is_err()
        || sample.high_pressure.value.is_err()
        || sample.oil_temperature.value.is_err()
}
