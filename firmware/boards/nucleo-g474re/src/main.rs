//! Firmware for ST's NUCLEO-G474RE: the application's tasks, each in an executor of its priority.
//!
//! | module | duty |
//! |---|---|
//! | [`backtrace`] | stack and program memory for the backtrace of a panic |
//! | [`can`] | CAN driver |
//! | [`flash`] | record region, production page, damaged words |
//! | [`clocks`] | 170 MHz from the board's crystal |
//! | [`pickups`] | edges of both pickups, stamped by timer 2 |
//! | [`watchdog`] | watchdog, reset cause, crash record, panics and hard faults |
//!
//! Pins and wiring: docs/nucleo.md. Every use of `unsafe` states its reason.
#![no_std]
#![no_main]
#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

mod backtrace;
mod can;
mod clocks;
mod flash;
mod pickups;
mod watchdog;

use defmt_rtt as _;
use embassy_executor::{InterruptExecutor, SpawnError, Spawner};
use embassy_stm32::flash::Flash;
use embassy_stm32::gpio::{Level, Output, Speed};
use embassy_stm32::interrupt::{InterruptExt, Priority};
use embassy_stm32::mode::Async;
use embassy_stm32::spi::{self, Spi};
use embassy_stm32::time::Hertz;
use embassy_stm32::{Peri, Peripherals, bind_interrupts, dma, interrupt, peripherals};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_time::Instant;
use embedded_hal_bus::spi::ExclusiveDevice;
use kou_app::controller::{
    AdcSampler, CanInterface, Controller, Estimator, NoEstimate, Publish, SensorsMemory, StorageTask,
    WriteScheduleConfig, WriteScheduleParams, run_estimate, run_publish, run_sample, run_storage,
    run_supervise,
};
use kou_app::j1939::{Name, NameConfig, Node};
use kou_app::sensors::SensorsParams;
use kou_app::sensors::adc::Mcp3208;
use kou_app::sensors::wiring;
use kou_app::storage::Store;
use kou_app::update::{UpdateService, UpdateSession};
use kou_estimator::record::crc32;
use kou_estimator::units::{Celsius, Micros};
use kou_estimator::{Estimate, Reading, Sample};
use static_cell::StaticCell;

use crate::pickups::Pickups;
use crate::watchdog::WatchdogDriver;

defmt::timestamp!("{=u64:us}", Instant::now().as_micros());

bind_interrupts!(struct Irqs {
    DMA1_CHANNEL1 => dma::InterruptHandler<peripherals::DMA1_CH1>;
    DMA1_CHANNEL2 => dma::InterruptHandler<peripherals::DMA1_CH2>;
    TIM2 => pickups::Handler;
    FLASH => embassy_stm32::flash::InterruptHandler;
    FDCAN1_IT0 => embassy_stm32::can::IT0InterruptHandler<peripherals::FDCAN1>;
    FDCAN1_IT1 => embassy_stm32::can::IT1InterruptHandler<peripherals::FDCAN1>;
});

/// State shared by the tasks, which run at several priorities.
type SharedState = Controller<CriticalSectionRawMutex>;

/// Executors above the thread's, in interrupts of unused peripherals.
static HIGHEST: InterruptExecutor = InterruptExecutor::new();
static HIGH: InterruptExecutor = InterruptExecutor::new();
static LOW: InterruptExecutor = InterruptExecutor::new();

#[allow(unsafe_code, reason = "an interrupt's entry point is found by its name")]
#[interrupt]
unsafe fn UART4() {
    // SAFETY: called from the interrupt that was given to `HIGHEST.start`.
    unsafe { HIGHEST.on_interrupt() }
}

#[allow(unsafe_code, reason = "an interrupt's entry point is found by its name")]
#[interrupt]
unsafe fn UART5() {
    // SAFETY: called from the interrupt that was given to `HIGH.start`.
    unsafe { HIGH.on_interrupt() }
}

#[allow(unsafe_code, reason = "an interrupt's entry point is found by its name")]
#[interrupt]
unsafe fn LPUART1() {
    // SAFETY: called from the interrupt that was given to `LOW.start`.
    unsafe { LOW.on_interrupt() }
}

type NucleoFrontEnd = AdcSampler<
    Mcp3208<
        ExclusiveDevice<
            Spi<'static, Async, spi::mode::Master>,
            Output<'static>,
            embedded_hal_bus::spi::NoDelay,
        >,
    >,
    Pickups,
>;

/// Peripherals of the front end.
struct FrontEndPins {
    spi: Peri<'static, peripherals::SPI1>,
    spi_pins:
        (Peri<'static, peripherals::PA5>, Peri<'static, peripherals::PA7>, Peri<'static, peripherals::PA6>),
    dma: (Peri<'static, peripherals::DMA1_CH1>, Peri<'static, peripherals::DMA1_CH2>),
    select: Peri<'static, peripherals::PB6>,
    timer: Peri<'static, peripherals::TIM2>,
    pickups: (Peri<'static, peripherals::PA0>, Peri<'static, peripherals::PA1>),
}

/// Peripherals of the CAN bus.
struct CanPins {
    can: Peri<'static, peripherals::FDCAN1>,
    receive: Peri<'static, peripherals::PA11>,
    transmit: Peri<'static, peripherals::PA12>,
}

type FlashStorageTask = StorageTask<'static, Flash<'static, flash::Mode>, flash::Provisioned>;

// Working data of the tasks, outside of them: a task is built on the stack and then moved. Initialised at start:
// statics with initial values would occupy kilobytes of flash as well.
static CONTROLLER: StaticCell<SharedState> = StaticCell::new();
static STORE: StaticCell<Store<Flash<'static, flash::Mode>>> = StaticCell::new();
static SESSION: StaticCell<UpdateSession> = StaticCell::new();
static RECORDS: StaticCell<FlashStorageTask> = StaticCell::new();
static SENSORS: StaticCell<SensorsParams> = StaticCell::new();
static SENSORS_MEMORY: StaticCell<SensorsMemory> = StaticCell::new();
static FRONT_END: StaticCell<NucleoFrontEnd> = StaticCell::new();
static ESTIMATOR: StaticCell<Estimator> = StaticCell::new();
static PUBLISHER: StaticCell<Publisher> = StaticCell::new();

#[embassy_executor::task]
async fn sample(
    shared: &'static SharedState,
    start: Instant,
    params: &'static SensorsParams,
    front_end: &'static mut NucleoFrontEnd,
    memory: &'static mut SensorsMemory,
) {
    run_sample(shared, start, params, front_end, memory).await
}

#[embassy_executor::task]
async fn estimate(shared: &'static SharedState, start: Instant, estimator: &'static mut Estimator) {
    run_estimate(shared, start, estimator).await
}

#[embassy_executor::task]
async fn publish(shared: &'static SharedState, start: Instant, to: &'static mut Publisher) {
    run_publish(shared, start, to).await
}

#[embassy_executor::task]
async fn storage(shared: &'static SharedState, start: Instant, task: &'static mut FlashStorageTask) {
    run_storage(shared, start, task).await
}

#[embassy_executor::task]
async fn supervise(shared: &'static SharedState, start: Instant, mut watchdog_driver: WatchdogDriver) {
    run_supervise(shared, start, &mut watchdog_driver).await
}

/// Publishes on the bus, and logs when the estimates become valid or invalid.
struct Publisher {
    bus: CanInterface<'static, can::FdcanPort, CriticalSectionRawMutex>,
    was_valid: Option<bool>,
}

impl Publish for Publisher {
    async fn publish(
        &mut self,
        now: Micros,
        estimate: &Result<Estimate, NoEstimate>,
        sample: Option<&Sample>,
    ) {
        self.bus.publish(now, estimate, sample).await;
        let valid = estimate.is_ok_and(|estimate| estimate.observed.is_ok());
        if self.was_valid != Some(valid) {
            self.was_valid = Some(valid);
            let why = estimate.map(|estimate| estimate.observed.err());
            defmt::info!("estimates valid: {=bool}; {}", valid, why);
        }
    }

    fn external_oil_temperature(&self, now: Micros) -> Reading<Celsius> {
        self.bus.external_oil_temperature(now)
    }
}

/// Preferred address, from the range that J1939 leaves free to be claimed (128 to 247).
const ADDRESS: u8 = 0x8C;

/// Address of the controller whose oil temperature (SPN 177) checks the own thermometer; `None` without one.
const OIL_FROM: Option<u8> = None;

/// Serial number in the controller's NAME: 21 bits of the chip's unique identifier, so that two controllers on a bus
/// differ.
fn identity() -> u32 {
    crc32(&embassy_stm32::uid::uid()) & 0x1F_FFFF
}

/// SPI clock of the converter: 1 MHz, as its data sheet allows at 3.3 V.
const ADC_CLOCK: Hertz = Hertz(1_000_000);

/// Initialises a static once. Not inlined, so that temporaries leave the stack at once.
#[inline(never)]
fn init_static<T>(place: &'static StaticCell<T>, make: impl FnOnce() -> T) -> &'static mut T {
    match place.try_init_with(make) {
        Some(value) => value,
        None => watchdog::stop("made twice"),
    }
}

fn shared() -> &'static SharedState {
    init_static(&CONTROLLER, Controller::new)
}

#[inline(never)]
fn sensors() -> &'static SensorsParams {
    let params = || match SensorsParams::new(&wiring::REFERENCE) {
        Ok(params) => params,
        Err(_) => watchdog::stop("wiring"),
    };
    init_static(&SENSORS, params)
}

/// Converter and timer.
#[inline(never)]
fn front_end(pins: FrontEndPins) -> &'static mut NucleoFrontEnd {
    let mut config = spi::Config::default();
    config.frequency = ADC_CLOCK;
    let (sck, mosi, miso) = pins.spi_pins;
    let (tx, rx) = pins.dma;
    let spi = Spi::new(pins.spi, sck, mosi, miso, tx, rx, Irqs, config);
    let select = Output::new(pins.select, Level::High, Speed::Medium);
    // Setting a pin cannot fail.
    let Ok(device) = ExclusiveDevice::new_no_delay(spi, select);
    let (pump, motor) = pins.pickups;
    let timer = Pickups::new(pins.timer, pump, motor, Irqs);
    init_static(&FRONT_END, || AdcSampler::new(Mcp3208::new(device), timer))
}

#[inline(never)]
fn publisher(shared: &'static SharedState, pins: CanPins) -> &'static mut Publisher {
    let Ok(name) = Name::new(&NameConfig::transmission(identity())) else { watchdog::stop("name") };
    let Some(port) = can::FdcanPort::new(pins.can, pins.receive, pins.transmit, Irqs) else {
        watchdog::stop("CAN")
    };
    init_static(&PUBLISHER, || {
        let bus = CanInterface::new(port, Node::new(name, ADDRESS), shared);
        Publisher {
            bus: OIL_FROM.into_iter().fold(bus, CanInterface::with_external_oil_temperature),
            was_valid: None,
        }
    })
}

#[inline(never)]
fn records(flash: Peri<'static, peripherals::FLASH>) -> &'static mut FlashStorageTask {
    let begin = watchdog::begin();
    let Ok(rates) = WriteScheduleParams::new(&WriteScheduleConfig::VEHICLE) else { watchdog::stop("rates") };
    let (store, session) = (store(flash), init_static(&SESSION, UpdateSession::new));
    let service = UpdateService::new(store, session, flash::Provisioned, flash::default_calibration());
    init_static(&RECORDS, || StorageTask::new(service, rates, begin))
}

#[inline(never)]
fn store(flash: Peri<'static, peripherals::FLASH>) -> &'static mut Store<Flash<'static, flash::Mode>> {
    let store = || match flash::store(flash, Irqs) {
        Ok(store) => store,
        Err(_) => watchdog::stop("flash is not two banks"),
    };
    init_static(&STORE, store)
}

fn start(spawner: Spawner, p: Peripherals) -> Result<(), SpawnError> {
    let watchdog_driver = WatchdogDriver::new(p.IWDG);
    let shared: &'static SharedState = shared();
    let records = records(p.FLASH);
    let (params, memory) = (sensors(), init_static(&SENSORS_MEMORY, SensorsMemory::new));
    let front_end = front_end(FrontEndPins {
        spi: p.SPI1,
        spi_pins: (p.PA5, p.PA7, p.PA6),
        dma: (p.DMA1_CH1, p.DMA1_CH2),
        select: p.PB6,
        timer: p.TIM2,
        pickups: (p.PA0, p.PA1),
    });
    let publisher = publisher(shared, CanPins { can: p.FDCAN1, receive: p.PA11, transmit: p.PA12 });
    let estimator = init_static(&ESTIMATOR, Estimator::new);

    interrupt::UART4.set_priority(Priority::P6);
    interrupt::UART5.set_priority(Priority::P7);
    interrupt::LPUART1.set_priority(Priority::P8);
    let (highest, high) = (HIGHEST.start(interrupt::UART4), HIGH.start(interrupt::UART5));
    // The thread is left to the storage task: searching the flash takes longer than a period of the bus.
    let low = LOW.start(interrupt::LPUART1);
    let start = Instant::now();
    highest.spawn(sample(shared, start, params, front_end, memory)?);
    high.spawn(estimate(shared, start, estimator)?);
    low.spawn(publish(shared, start, publisher)?);
    low.spawn(supervise(shared, start, watchdog_driver)?);
    spawner.spawn(storage(shared, start, records)?);
    Ok(())
}

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    let p = embassy_stm32::init(clocks::config());
    defmt::info!("{=str} {=str} up", env!("CARGO_PKG_NAME"), env!("CARGO_PKG_VERSION"));
    if start(spawner, p).is_err() {
        watchdog::stop("task");
    }
}
