//! Task `sample`: reads the front end each millisecond, and puts a sample together for every turn of `estimate`.

use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::Instant;

use super::periodic::{Ticker, now};
use super::periods::{ESTIMATE_PERIOD, SAMPLE_PERIOD};
use super::shared::Controller;
use crate::log::warning;
use crate::sensors::adc::{Adc, Input};
use crate::sensors::pickup::Edges;
use crate::sensors::set::{CHANNELS, SensorInputs, SensorsParams, SensorsState};

/// Everything that a drive's sensors are connected to.
#[allow(async_fn_in_trait, reason = "called by tasks that are not sent between threads")]
pub trait FrontEnd {
    /// Reads all: a conversion of each wanted input, and the edges since the last call.
    async fn read(&mut self, wanted: &[Option<Input>; CHANNELS], into: &mut SensorInputs);
}

/// The timer that stamps the pickups' edges.
pub trait EdgeTimer {
    /// Hands over the edges since the last call, and returns the timer's count now.
    fn take(&mut self, pump: &mut Edges, motor: &mut Edges) -> u32;
}

/// The usual front end: a converter and a timer.
#[derive(Debug)]
pub struct AdcSampler<A, T> {
    adc: A,
    timer: T,
}

impl<A: Adc, T: EdgeTimer> AdcSampler<A, T> {
    /// Puts the two together.
    pub const fn new(adc: A, timer: T) -> Self {
        Self { adc, timer }
    }
}

impl<A: Adc, T: EdgeTimer> FrontEnd for AdcSampler<A, T> {
    async fn read(&mut self, wanted: &[Option<Input>; CHANNELS], into: &mut SensorInputs) {
        // First the edges: they are stamped already, and the conversions take their time.
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

/// What the task remembers. It lies outside of the task, which is moved when it is begun.
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

/// Turns of this task for one of `estimate`.
const CYCLES: u64 = ESTIMATE_PERIOD.as_ticks() / SAMPLE_PERIOD.as_ticks();

/// Samples for ever.
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
                // Which one, and how, is logged as a trouble.
                warning!("sensors failed: {=bool}", faults);
                faulty = faults;
            }
        }
    }
}

/// Makes the sample for `estimate`; whether a sensor has failed that it cannot do without.
// Not inlined: a sample would lie in the task's memory for good.
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
