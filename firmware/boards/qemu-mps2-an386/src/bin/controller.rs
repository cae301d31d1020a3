//! Vehicle controller in QEMU: the tasks of a vehicle's board, with hardware that the host emulates.
//!
//! `host-sim pil --plant` starts it and runs a scenario.
#![no_std]
#![no_main]
#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m_rt::entry;
use embassy_executor::SpawnError;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_time::{Duration, Instant};
use heapless::Vec;
use kou_app::controller::{
    AdcSampler, CanInterface, Controller, Estimator, SensorsMemory, StartReason, StorageTask,
    WriteScheduleConfig, WriteScheduleParams, run_estimate, run_publish, run_sample, run_storage,
    run_supervise,
};
use kou_app::j1939::{Name, NameConfig, Node};
use kou_app::sensors::adc::{Mcp3208, request};
use kou_app::sensors::{SensorsParams, wiring};
use kou_app::storage::Store;
use kou_app::update::{UpdateService, UpdateSession};
use kou_emulation::{FLASH_LEN, MAX_LEN, TickReport};
use kou_estimator::units::Micros;
use kou_qemu_mps2_an386::emulated::{
    EmulatedCan, EmulatedSpi, EmulatedTimer, EmulatedWatchdog, HostBackedFlash, HostKey, HostLine,
};
use kou_qemu_mps2_an386::exit::Exit;
use kou_qemu_mps2_an386::{QemuMps2An386, priority, stack};
use static_cell::{ConstStaticCell, StaticCell};

static CONTROLLER: Controller<CriticalSectionRawMutex> = Controller::new();
static FED: AtomicU32 = AtomicU32::new(0);

/// Serial number and preferred address on the bus.
const SERIAL: u32 = 1;
const ADDRESS: u8 = 0x8C;

/// Cycles of the sampling task between two outputs, and between two reports of timing statistics.
const OUTPUT_CYCLES: u32 = 10;
const STATS_CYCLES: u32 = 1000;

type QemuFrontEnd = AdcSampler<Mcp3208<EmulatedSpi>, EmulatedTimer<fn(&mut TickReport)>>;

type ControllerStorageTask = StorageTask<'static, HostBackedFlash, HostKey>;

static STORE: StaticCell<Store<HostBackedFlash>> = StaticCell::new();
static SESSION: ConstStaticCell<UpdateSession> = ConstStaticCell::new(UpdateSession::new());
static RECORDS: StaticCell<ControllerStorageTask> = StaticCell::new();
static SENSORS: StaticCell<SensorsParams> = StaticCell::new();
static SENSORS_MEMORY: ConstStaticCell<SensorsMemory> = ConstStaticCell::new(SensorsMemory::new());
static ESTIMATOR: ConstStaticCell<Estimator> = ConstStaticCell::new(Estimator::new());
/// First message of the host; holds the default calibration.
static FIRST: ConstStaticCell<[u8; MAX_LEN]> = ConstStaticCell::new([0; MAX_LEN]);

#[embassy_executor::task]
async fn sample(
    start: Instant,
    params: &'static SensorsParams,
    mut front_end: QemuFrontEnd,
    memory: &'static mut SensorsMemory,
) {
    run_sample(&CONTROLLER, start, params, &mut front_end, memory).await
}

#[embassy_executor::task]
async fn estimate(start: Instant, estimator: &'static mut Estimator) {
    run_estimate(&CONTROLLER, start, estimator).await
}

#[embassy_executor::task]
async fn publish(start: Instant) {
    let Ok(name) = Name::new(&NameConfig::transmission(SERIAL)) else { Exit::Spawn.now() };
    run_publish(
        &CONTROLLER,
        start,
        &mut CanInterface::new(EmulatedCan::new(), Node::new(name, ADDRESS), &CONTROLLER),
    )
    .await
}

#[embassy_executor::task]
async fn store(start: Instant, records: &'static mut ControllerStorageTask) {
    run_storage(&CONTROLLER, start, records).await
}

#[embassy_executor::task]
async fn supervise(start: Instant) {
    run_supervise(&CONTROLLER, start, &mut EmulatedWatchdog::new(&FED)).await
}

/// Fills in the outputs of a report to the host.
fn fill_report(message: &mut TickReport) {
    message.writing = CONTROLLER.writing().map(|kind| kind as u8);
    message.fed = FED.load(Ordering::Relaxed);
    if message.tick % OUTPUT_CYCLES == 1 {
        message.output = Some(CONTROLLER.output(Micros(Instant::now().as_micros())));
        message.sample = CONTROLLER.sample();
    }
    if message.tick % STATS_CYCLES == 1 {
        message.task_stats = Some(CONTROLLER.task_stats.read());
        message.stack_bytes = STACK.load(Ordering::Relaxed);
    }
}

/// Deepest stack as last measured: the measurement takes milliseconds, so the thread does it, below all tasks.
static STACK: AtomicU32 = AtomicU32::new(0);
const STACK_PERIOD: Duration = Duration::from_millis(500);
/// Iterations of the idle loop between two reads of the clock: about a millisecond.
const IDLE_ITERATIONS: u32 = 8000;

/// Storage task with its initial conditions, from the host's first message.
fn records(mut line: HostLine) -> Option<&'static mut ControllerStorageTask> {
    let first = line.begin(FIRST.try_take()?)?;
    line.share();
    let default = (!first.default.is_empty()).then_some(first.default);
    let rates = WriteScheduleConfig {
        health_s: first.write_period_s,
        counters_s: first.write_period_s,
        ..WriteScheduleConfig::VEHICLE
    };
    let store = Store::new(HostBackedFlash::new(|| CONTROLLER.writing())?, 0..FLASH_LEN as u32).ok()?;
    let rates = WriteScheduleParams::new(&rates).ok()?;
    let begin = StartReason { cause: first.cause, crash_record: first.crash_record };
    let service =
        UpdateService::new(STORE.try_init(store)?, SESSION.try_take()?, HostKey(first.key), default);
    RECORDS.try_init_with(|| StorageTask::new(service, rates, begin))
}

fn start(line: HostLine) -> Result<(), SpawnError> {
    let Some(records) = records(line) else { Exit::LineFailed.now() };
    let Ok(params) = SensorsParams::new(&wiring::REFERENCE) else { Exit::Spawn.now() };
    let requests: Vec<_, { kou_app::sensors::set::CHANNELS }> =
        params.inputs().iter().flatten().map(|input| request(*input)).collect();
    let front_end = AdcSampler::new(
        Mcp3208::new(EmulatedSpi::new()),
        EmulatedTimer::new(requests, fill_report as fn(&mut TickReport)),
    );
    let [highest, high, low, lowest] = priority::start();
    let start = Instant::now();
    highest.spawn(sample(start, SENSORS.init(params), front_end, SENSORS_MEMORY.take())?);
    high.spawn(estimate(start, ESTIMATOR.take())?);
    low.spawn(publish(start)?);
    low.spawn(supervise(start)?);
    // Last: it starts at once, above this thread, and reads the flash before it yields.
    lowest.spawn(store(start, records)?);
    Ok(())
}

#[entry]
fn main() -> ! {
    QemuMps2An386::init();
    defmt::info!("controller {=str} up", env!("CARGO_PKG_VERSION"));
    let Ok(line) = HostLine::open() else {
        semihosting::eprintln!(
            "nobody is on the controller's line; `host-sim pil --plant` starts it and drives it"
        );
        Exit::Shutdown.now()
    };
    if start(line).is_err() {
        Exit::Spawn.now()
    }
    let mut measured_at = Instant::now();
    loop {
        // No sleep: with `-icount`, QEMU's clock overshoots the next alarm by up to a millisecond when its processor
        // wakes. Nor a read of the clock in every iteration: QEMU ends a block of translated code at each device
        // access, which would take half of a run.
        for _ in 0..IDLE_ITERATIONS {
            cortex_m::asm::nop();
        }
        if measured_at.elapsed() >= STACK_PERIOD {
            measured_at = Instant::now();
            STACK.store(stack::high_water_bytes(), Ordering::Relaxed);
        }
    }
}
