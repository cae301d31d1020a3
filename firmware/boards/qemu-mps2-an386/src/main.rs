//! PIL firmware for QEMU's mps2-an386: the server's tasks in one executor.
#![no_std]
#![no_main]
#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use embassy_executor::{SpawnError, Spawner};
use embassy_sync::blocking_mutex::raw::ThreadModeRawMutex;
use embassy_time::{Duration, Timer};
use kou_pil::server::{LinkEnd, ServerChannels, run_estimate, run_heartbeat, run_link_in, run_link_out};
use kou_qemu_mps2_an386::QemuMps2An386;
use kou_qemu_mps2_an386::exit::Exit;
use kou_qemu_mps2_an386::line::{self, Requests, Responses};
use kou_qemu_mps2_an386::uart::{self, UartReceiver, UartSender};
use semihosting::experimental::env;

/// Every task runs in thread mode, so the channels need no critical section.
type Mutex = ThreadModeRawMutex;

static CHANNELS: ServerChannels<Mutex> = ServerChannels::new();

/// Bytes per read from the line; a pipe delivers at most this much at once.
const CHUNK_LEN: usize = 4096;
/// Bytes per read from the UART, which delivers them singly.
const UART_CHUNK_LEN: usize = 64;
const HEARTBEAT: Duration = Duration::from_millis(100);
/// Time after which the firmware ends without a host.
const ALONE: Duration = Duration::from_secs(1);

#[embassy_executor::task]
async fn link_in(mut requests: Requests<Mutex>) {
    let mut chunk = [0; CHUNK_LEN];
    end(run_link_in(&CHANNELS, &mut requests, &mut chunk).await)
}

#[embassy_executor::task]
async fn estimate(board: QemuMps2An386) {
    run_estimate(&CHANNELS, &board).await
}

#[embassy_executor::task]
async fn link_out(mut responses: Responses) {
    end(run_link_out(&CHANNELS, &mut responses).await)
}

#[embassy_executor::task]
async fn uart_in(mut receiver: UartReceiver) {
    let mut chunk = [0; UART_CHUNK_LEN];
    end(run_link_in(&CHANNELS, &mut receiver, &mut chunk).await)
}

#[embassy_executor::task]
async fn uart_out(mut sender: UartSender) {
    end(run_link_out(&CHANNELS, &mut sender).await)
}

#[embassy_executor::task]
async fn heartbeat() {
    run_heartbeat(&CHANNELS, HEARTBEAT).await
}

/// Exits with the code of the link's end.
fn end(reason: LinkEnd) -> ! {
    let exit = match reason {
        LinkEnd::Shutdown => Exit::Shutdown,
        LinkEnd::Closed => Exit::HostGone,
        LinkEnd::Failed => Exit::LineFailed,
    };
    defmt::info!("end: {}", exit);
    exit.now()
}

/// Whether the command line selects UART 0 instead of files.
fn wants_uart() -> bool {
    env::args::<128>().is_ok_and(|arguments| (&arguments).into_iter().flatten().any(|word| word == "uart"))
}

fn start(spawner: Spawner, board: QemuMps2An386) -> Result<bool, SpawnError> {
    spawner.spawn(heartbeat()?);
    spawner.spawn(estimate(board)?);
    if wants_uart() {
        let (receiver, sender) = uart::open();
        spawner.spawn(uart_in(receiver)?);
        spawner.spawn(uart_out(sender)?);
        return Ok(true);
    }
    let Ok((requests, responses)) = line::open(&CHANNELS.in_flight) else { return Ok(false) };
    spawner.spawn(link_in(requests)?);
    spawner.spawn(link_out(responses)?);
    Ok(true)
}

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    let board = QemuMps2An386::init();
    defmt::info!("{=str} {=str} up", env!("CARGO_PKG_NAME"), env!("CARGO_PKG_VERSION"));
    match start(spawner, board) {
        Ok(true) => {}
        Ok(false) => {
            semihosting::eprintln!(
                "{} {} is up, but nobody is on its link: there are no files {:?} and {:?} in the working \
                 directory. `host-sim pil` makes them and talks to it. Ends after {} s.",
                env!("CARGO_PKG_NAME"),
                env!("CARGO_PKG_VERSION"),
                line::REQUESTS,
                line::RESPONSES,
                ALONE.as_secs(),
            );
            Timer::after(ALONE).await;
            Exit::Shutdown.now()
        }
        Err(_) => Exit::Spawn.now(),
    }
}
