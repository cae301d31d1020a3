//! The leakage estimator's firmware for ST's NUCLEO-G474RE: the application's tasks, each in an executor of its priority.
//!
//! | module | duty |
//! |---|---|
//! | [`can`] | the CAN bus |
//! | [`flash`] | where records are kept, what production wrote, words that a power cut has spoilt |
//! | [`clocks`] | 170 MHz from the board's crystal |
//! | [`pickups`] | edges of both pickups, stamped by timer 2 |
//! | [`keeper`] | watchdog, reset cause, the note across a reset, panics and hard faults |
//!
//! The pins are in the README. `unsafe` stands where hardware needs it, each use with its reason.
#![no_std]
#![no_main]
#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

mod can;
mod clocks;
mod flash;
mod keeper;
mod pickups;

use defmt_rtt as _;
use embassy_executor::{InterruptExecutor, SpawnError, Spawner};
use embassy_stm32::flash::Flash;
use embassy_stm32::gpio::{Level, Output, Speed};
use embassy_stm32::interrupt::{InterruptExt, Priority};
use embassy_stm32::mode::Async;
use embassy_stm32::spi::{self, Spi};
use embassy_stm32::time::Hertz;
use embassy_stm32::{Peripherals, bind_interrupts, dma, interrupt, peripherals};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_time::Instant;
use embedded_hal_bus::spi::ExclusiveDevice;
use kou_app::controller::{
    Begin, Bus, Controller, KeepConfig, KeepParams, Keeper as Records, NoEstimate, Publish, Sampler,
    run_estimate, run_publish, run_sample, run_store, run_supervise,
};
use kou_app::j1939::{Name, NameConfig, Node};
use kou_app::sensors::SensorsParams;
use kou_app::sensors::adc::Mcp3208;
use kou_app::sensors::wiring;
use kou_app::update::Service;
use kou_estimator::calibration::record::crc32;
use kou_estimator::units::{Celsius, Micros};
use kou_estimator::{Estimate, Reading, Sample};
use static_cell::StaticCell;

use crate::keeper::Keeper;
use crate::pickups::Pickups;

defmt::timestamp!("{=u64:us}", Instant::now().as_micros());

bind_interrupts!(struct Irqs {
    DMA1_CHANNEL1 => dma::InterruptHandler<peripherals::DMA1_CH1>;
    DMA1_CHANNEL2 => dma::InterruptHandler<peripherals::DMA1_CH2>;
    TIM2 => pickups::Handler;
    FLASH => embassy_stm32::flash::InterruptHandler;
    FDCAN1_IT0 => embassy_stm32::can::IT0InterruptHandler<peripherals::FDCAN1>;
    FDCAN1_IT1 => embassy_stm32::can::IT1InterruptHandler<peripherals::FDCAN1>;
});

/// What the tasks, of three priorities, share.
type Shared = Controller<CriticalSectionRawMutex>;

// Made at start: as a static with a value it would lie in flash as well, two kilobytes of it.
static CONTROLLER: StaticCell<Shared> = StaticCell::new();

/// Executors above the thread's, on interrupts of peripherals that the board does not use.
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

type FrontEnd = Sampler<
    Mcp3208<
        ExclusiveDevice<
            Spi<'static, Async, spi::mode::Master>,
            Output<'static>,
            embedded_hal_bus::spi::NoDelay,
        >,
    >,
    Pickups,
>;

type FlashRecords = Records<'static, Flash<'static, flash::Mode>, flash::Provisioned>;

static RECORDS: StaticCell<FlashRecords> = StaticCell::new();

#[embassy_executor::task]
async fn sample(shared: &'static Shared, start: Instant, params: SensorsParams, mut front_end: FrontEnd) {
    run_sample(shared, start, &params, &mut front_end).await
}

#[embassy_executor::task]
async fn estimate(shared: &'static Shared, start: Instant) {
    run_estimate(shared, start).await
}

#[embassy_executor::task]
async fn publish(shared: &'static Shared, start: Instant, node: Node, port: can::Port) {
    let mut to = Told { bus: Bus::new(port, node, shared), was_valid: None };
    run_publish(shared, start, &mut to).await
}

#[embassy_executor::task]
async fn store(shared: &'static Shared, start: Instant, begin: Begin, records: &'static mut FlashRecords) {
    run_store(shared, start, begin, records).await
}

#[embassy_executor::task]
async fn supervise(shared: &'static Shared, start: Instant, mut keeper: Keeper) {
    run_supervise(shared, start, &mut keeper).await
}

/// Tells the bus, and the log when the estimates become valid and when they cease to be.
struct Told {
    bus: Bus<'static, can::Port, CriticalSectionRawMutex>,
    was_valid: Option<bool>,
}

impl Publish for Told {
    async fn publish(
        &mut self,
        now: Micros,
        estimate: &Result<Estimate, NoEstimate>,
        sample: Option<&Sample>,
    ) {
        self.bus.publish(now, estimate, sample).await;
        let valid = estimate.is_ok_and(|estimate| estimate.seen.is_ok());
        if self.was_valid != Some(valid) {
            self.was_valid = Some(valid);
            let why = estimate.map(|estimate| estimate.seen.err());
            defmt::info!("estimates valid: {=bool}; {}", valid, why);
        }
    }

    fn oil_heard(&self, now: Micros) -> Reading<Celsius> {
        self.bus.oil_heard(now)
    }
}

/// Preferred address on the bus, of those that J1939 leaves free to be claimed (128 to 247).
const ADDRESS: u8 = 0x8C;

/// Serial number in the controller's NAME: 21 bits of the chip's own, so that two controllers on a bus differ.
fn identity() -> u32 {
    crc32(&embassy_stm32::uid::uid()) & 0x1F_FFFF
}

/// SPI clock of the converter: 1 MHz from a 3.3 V supply is what its data sheet allows.
const ADC_CLOCK: Hertz = Hertz(1_000_000);

fn start(spawner: Spawner, p: Peripherals, begin: Begin) -> Result<(), SpawnError> {
    let keeper = Keeper::new(p.IWDG);
    let mut config = spi::Config::default();
    config.frequency = ADC_CLOCK;
    let spi = Spi::new(p.SPI1, p.PA5, p.PA7, p.PA6, p.DMA1_CH1, p.DMA1_CH2, Irqs, config);
    let select = Output::new(p.PB6, Level::High, Speed::Medium);
    // Setting a pin cannot fail.
    let Ok(device) = ExclusiveDevice::new_no_delay(spi, select);
    let front_end = Sampler::new(Mcp3208::new(device), Pickups::new(p.TIM2, p.PA0, p.PA1, Irqs));
    let Ok(params) = SensorsParams::new(&wiring::REFERENCE) else { keeper::stop(format_args!("wiring")) };

    let Ok(name) = Name::new(&NameConfig::transmission(identity())) else {
        keeper::stop(format_args!("name"))
    };
    let Some(port) = can::Port::new(p.FDCAN1, p.PA11, p.PA12, Irqs) else {
        keeper::stop(format_args!("CAN"))
    };
    let Ok(rates) = KeepParams::new(&KeepConfig::VEHICLE) else { keeper::stop(format_args!("rates")) };
    let Ok(records) = flash::store(p.FLASH, Irqs) else {
        keeper::stop(format_args!("flash is not two banks"))
    };
    // In place: it is two kilobytes, and no copy of it belongs on the stack.
    let keep =
        || Records::new(Service::new(records, flash::Provisioned, flash::default_calibration()), rates);
    let Some(records) = RECORDS.try_init_with(keep) else { keeper::stop(format_args!("records")) };

    let Some(shared) = CONTROLLER.try_init_with(Controller::new) else {
        keeper::stop(format_args!("shared"))
    };
    let shared: &'static Shared = shared;

    interrupt::UART4.set_priority(Priority::P6);
    interrupt::UART5.set_priority(Priority::P7);
    interrupt::LPUART1.set_priority(Priority::P8);
    let (highest, high) = (HIGHEST.start(interrupt::UART4), HIGH.start(interrupt::UART5));
    // The thread is left to what is written to flash: searching it takes longer than a period of the bus.
    let low = LOW.start(interrupt::LPUART1);
    let start = Instant::now();
    highest.spawn(sample(shared, start, params, front_end)?);
    high.spawn(estimate(shared, start)?);
    low.spawn(publish(shared, start, Node::new(name, ADDRESS), port)?);
    low.spawn(supervise(shared, start, keeper)?);
    spawner.spawn(store(shared, start, begin, records)?);
    Ok(())
}

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    let p = embassy_stm32::init(clocks::config());
    defmt::info!("{=str} {=str} up", env!("CARGO_PKG_NAME"), env!("CARGO_PKG_VERSION"));
    let begin = keeper::begin();
    if start(spawner, p, begin).is_err() {
        keeper::stop(format_args!("task"));
    }
}
