//! Emulated hardware of the controller in QEMU: converter, timer, CAN, flash and watchdog, simulated by the host.
//!
//! Once per millisecond, when the sampling task reads the edges, one message goes to the host and one comes back. It
//! contains the converter's transactions of that millisecond, because the task requests the same inputs each time.
//! The driver still clocks its own bytes: an unexpected transaction fails.
//!
//! The flash is simulated by the host as well. Its operations are exchanged at once, with interrupts off, since both
//! kinds of message share the line; the duration of the hardware is waited for afterwards while other tasks run, as
//! with the second bank of an STM32G474.

use core::cell::RefCell;
use core::ops::Range;

use critical_section::Mutex;
use embassy_time::{Duration, Timer};
use embedded_hal_async::spi::{ErrorKind, ErrorType, Operation, SpiDevice};
use embedded_storage_async::nor_flash::{
    ErrorType as FlashErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use heapless::{Deque, Vec};
use kou_app::controller::{CanPort, EdgeTimer, Task, Watchdog};
use kou_app::j1939::{Frame, Id};
use kou_app::sensors::pickup::Edges;
use kou_app::sensors::set::CHANNELS;
use kou_app::storage::RecordKind;
use kou_app::update::{Key, KeySource};
use kou_emulation::ram_flash;
use kou_emulation::{
    CanFrame, EmulationStart, FLASH_CHUNK, FLASH_LEN, FLASH_PAGE, FirmwareMessage, FlashDone, FlashWork,
    MAX_LEN, Order, TickReply, TickReport, pack, unpack,
};
use semihosting::fs::File;
use semihosting::io::{self, Read, Write};
use static_cell::ConstStaticCell;

use crate::exit::Exit;
use crate::line::{REQUESTS, RESPONSES};

/// Transactions of this millisecond: bytes out, bytes in.
type Transactions = Vec<([u8; 3], [u8; 3]), CHANNELS>;

static TRANSACTIONS: Mutex<RefCell<Transactions>> = Mutex::new(RefCell::new(Vec::new()));

/// Length of a CAN controller's queues.
const CAN_QUEUE: usize = 16;
static TX_QUEUE: Mutex<RefCell<Deque<CanFrame, CAN_QUEUE>>> = Mutex::new(RefCell::new(Deque::new()));
static RX_QUEUE: Mutex<RefCell<Deque<CanFrame, CAN_QUEUE>>> = Mutex::new(RefCell::new(Deque::new()));

/// CAN controller on a bus that the host simulates.
pub struct EmulatedCan(());

impl EmulatedCan {
    /// CAN controller with empty queues.
    #[must_use]
    pub const fn new() -> Self {
        Self(())
    }
}

impl Default for EmulatedCan {
    fn default() -> Self {
        Self::new()
    }
}

impl CanPort for EmulatedCan {
    fn receive(&mut self) -> Option<Frame> {
        let (id, data) = critical_section::with(|cs| RX_QUEUE.borrow_ref_mut(cs).pop_front())?;
        Frame::of(Id::from_raw(id), &data)
    }

    fn send(&mut self, frame: &Frame) -> bool {
        let Ok(data) = Vec::from_slice(frame.data()) else { return false };
        critical_section::with(|cs| TX_QUEUE.borrow_ref_mut(cs).push_back((frame.id().raw(), data))).is_ok()
    }
}

/// Line to the host.
pub struct HostLine {
    from_host: File,
    to_host: File,
}

impl HostLine {
    /// Opens the line; the host opens its ends in the same order.
    ///
    /// # Errors
    /// The files do not exist: no host is present.
    pub fn open() -> io::Result<Self> {
        Ok(Self { from_host: File::open(REQUESTS)?, to_host: File::create(RESPONSES)? })
    }

    /// Next message from the host: at most [`MAX_LEN`] bytes, in one piece.
    fn receive<'a>(&mut self, buffer: &'a mut [u8; MAX_LEN]) -> Option<&'a [u8]> {
        let length = self.from_host.read(buffer).ok().filter(|&length| length > 0)?;
        buffer.get(..length)
    }

    /// First message of the host.
    pub fn begin<'a>(&mut self, buffer: &'a mut [u8; MAX_LEN]) -> Option<EmulationStart<'a>> {
        unpack(self.receive(buffer)?).map(|(begin, _)| begin)
    }

    /// Shares the line between timer and flash.
    pub fn share(self) {
        critical_section::with(|cs| *LINE.borrow_ref_mut(cs) = Some(self));
    }
}

static LINE: Mutex<RefCell<Option<HostLine>>> = Mutex::new(RefCell::new(None));

/// Sends a message and receives its answer. Interrupts are off meanwhile, and time stands still while the host works;
/// encoding and decoding, which take time, are excluded.
fn exchange_message<T: serde::de::DeserializeOwned>(message: &FirmwareMessage) -> Option<T> {
    let (mut out, mut back) = ([0; MAX_LEN], [0; MAX_LEN]);
    let bytes = pack(message, &mut out)?;
    let length = critical_section::with(|cs| {
        let mut line = LINE.borrow_ref_mut(cs);
        let line = line.as_mut()?;
        line.to_host.write_all(bytes).ok()?;
        line.receive(&mut back).map(<[u8]>::len)
    })?;
    unpack(back.get(..length)?).map(|(answer, _)| answer)
}

/// Flash whose cells belong to the host; reads come from a copy in RAM, without delay, like memory-mapped flash.
pub struct HostBackedFlash {
    writing: fn() -> Option<RecordKind>,
    copy: &'static mut [u8; FLASH_LEN],
}

static COPY: ConstStaticCell<[u8; FLASH_LEN]> = ConstStaticCell::new([0; FLASH_LEN]);

/// Error: the host's flash failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, defmt::Format)]
pub struct EmulatedFlashError;

impl NorFlashError for EmulatedFlashError {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

/// Duration of programming a word and of erasing a page, from the data sheet of the STM32G474.
const WORD_TIME: Duration = Duration::from_micros(85);
const PAGE_TIME: Duration = Duration::from_millis(22);

impl HostBackedFlash {
    /// Flash over the shared line, once; `writing` returns the kind of the record that is being written, as a target
    /// for the host's power failures.
    #[must_use]
    pub fn new(writing: fn() -> Option<RecordKind>) -> Option<Self> {
        let mut flash = Self { writing, copy: COPY.try_take()? };
        flash.refresh(0..FLASH_LEN)?;
        Some(flash)
    }

    /// Copies the content of the host's cells.
    fn refresh(&mut self, range: Range<usize>) -> Option<()> {
        let offsets = range.clone().step_by(FLASH_CHUNK);
        for (offset, chunk) in offsets.zip(self.copy.get_mut(range)?.chunks_mut(FLASH_CHUNK)) {
            let length = u16::try_from(chunk.len()).ok()?;
            let work = FlashWork::Read { offset: u32::try_from(offset).ok()?, length };
            let read = exchange_message::<FlashDone>(&FirmwareMessage::Flash { of: None, work })??;
            chunk.copy_from_slice(read.get(..chunk.len())?);
        }
        Some(())
    }

    fn work(&self, work: FlashWork) -> Result<Vec<u8, FLASH_CHUNK>, EmulatedFlashError> {
        let of = (self.writing)().map(|kind| kind as u8);
        let Some(done) = exchange_message::<FlashDone>(&FirmwareMessage::Flash { of, work }) else {
            Exit::HostGone.now()
        };
        done.ok_or(EmulatedFlashError)
    }
}

impl FlashErrorType for HostBackedFlash {
    type Error = EmulatedFlashError;
}

impl ReadNorFlash for HostBackedFlash {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), EmulatedFlashError> {
        let start = usize::try_from(offset).map_err(|_| EmulatedFlashError)?;
        let cells =
            self.copy.get(start..).and_then(|rest| rest.get(..bytes.len())).ok_or(EmulatedFlashError)?;
        bytes.copy_from_slice(cells);
        Ok(())
    }

    fn capacity(&self) -> usize {
        FLASH_LEN
    }
}

impl NorFlash for HostBackedFlash {
    const WRITE_SIZE: usize = ram_flash::WORD;
    const ERASE_SIZE: usize = FLASH_PAGE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), EmulatedFlashError> {
        self.work(FlashWork::Erase { from, to })?;
        self.refresh(from as usize..to as usize).ok_or(EmulatedFlashError)?;
        let pages = to.saturating_sub(from) / FLASH_PAGE as u32;
        Timer::after(PAGE_TIME * pages).await;
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), EmulatedFlashError> {
        for (at, chunk) in (offset..).step_by(FLASH_CHUNK).zip(bytes.chunks(FLASH_CHUNK)) {
            let words = u32::try_from(chunk.len() / ram_flash::WORD).map_err(|_| EmulatedFlashError)?;
            let bytes = Vec::from_slice(chunk).map_err(|_| EmulatedFlashError)?;
            self.work(FlashWork::Write { offset: at, bytes })?;
            let at = at as usize;
            self.refresh(at..at.saturating_add(chunk.len())).ok_or(EmulatedFlashError)?;
            Timer::after(WORD_TIME * words).await;
        }
        Ok(())
    }
}

/// Key supplied by the host.
pub struct HostKey(pub Option<[u8; 32]>);

impl KeySource for HostKey {
    fn update_key(&self) -> Option<Key> {
        self.0.map(Key::new)
    }
}

/// Stamping timer; its read performs the exchange with the host.
pub struct EmulatedTimer<F> {
    tick: u32,
    requests: Vec<[u8; 3], CHANNELS>,
    fill: F,
}

impl<F: FnMut(&mut TickReport)> EmulatedTimer<F> {
    /// Timer that requests the conversions `requests` each time, and lets `fill` add the outputs to the report.
    pub fn new(requests: Vec<[u8; 3], CHANNELS>, fill: F) -> Self {
        Self { tick: 0, requests, fill }
    }

    fn exchange(&mut self) -> Option<TickReply> {
        let mut message = TickReport {
            tick: self.tick,
            spi: self.requests.clone(),
            output: None,
            sample: None,
            task_stats: None,
            stack_bytes: 0,
            fed: 0,
            writing: None,
            can: Vec::new(),
        };
        (self.fill)(&mut message);
        critical_section::with(|cs| {
            let mut sent = TX_QUEUE.borrow_ref_mut(cs);
            while let Some(frame) = sent.pop_front() {
                if let Err(frame) = message.can.push(frame) {
                    // There is room: it was just removed.
                    sent.push_front(frame).ok();
                    break;
                }
            }
        });
        exchange_message(&FirmwareMessage::Tick(message))
    }
}

impl<F: FnMut(&mut TickReport)> EdgeTimer for EmulatedTimer<F> {
    fn take(&mut self, pump: &mut Edges, motor: &mut Edges) -> u32 {
        self.tick = self.tick.wrapping_add(1);
        let Some(answer) = self.exchange() else { Exit::HostGone.now() };
        if answer.order == Order::Stop {
            Exit::Shutdown.now();
        }
        critical_section::with(|cs| {
            let mut transactions = TRANSACTIONS.borrow_ref_mut(cs);
            transactions.clear();
            transactions.extend(self.requests.iter().copied().zip(answer.spi.iter().copied()));
            let mut received = RX_QUEUE.borrow_ref_mut(cs);
            for frame in answer.can {
                // A full queue loses the newest frame, like a CAN controller's.
                received.push_back(frame).ok();
            }
        });
        for (edges, stamps) in [(pump, &answer.pump), (motor, &answer.motor)] {
            for &stamp in stamps {
                edges.push(stamp);
            }
        }
        answer.count
    }
}

/// SPI bus and chip select of the converter.
pub struct EmulatedSpi(());

impl EmulatedSpi {
    /// SPI bus.
    #[must_use]
    pub const fn new() -> Self {
        Self(())
    }
}

impl Default for EmulatedSpi {
    fn default() -> Self {
        Self::new()
    }
}

impl ErrorType for EmulatedSpi {
    type Error = ErrorKind;
}

impl SpiDevice for EmulatedSpi {
    async fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), ErrorKind> {
        let [Operation::TransferInPlace(bytes)] = operations else { return Err(ErrorKind::Other) };
        critical_section::with(|cs| {
            let transactions = TRANSACTIONS.borrow_ref(cs);
            let (_, back) =
                transactions.iter().find(|(out, _)| out.as_slice() == &**bytes).ok_or(ErrorKind::Other)?;
            bytes.copy_from_slice(back);
            Ok(())
        })
    }
}

/// Watchdog that counts how often it was fed, and ends the emulation when a task is overdue.
pub struct EmulatedWatchdog {
    fed: &'static core::sync::atomic::AtomicU32,
}

impl EmulatedWatchdog {
    /// Watchdog that counts in `fed`.
    #[must_use]
    pub const fn new(fed: &'static core::sync::atomic::AtomicU32) -> Self {
        Self { fed }
    }
}

impl Watchdog for EmulatedWatchdog {
    fn feed(&mut self) {
        use core::sync::atomic::Ordering::Relaxed;
        self.fed.store(self.fed.load(Relaxed).wrapping_add(1), Relaxed);
    }

    fn give_up(&mut self, task: Task) {
        defmt::error!("watchdog: {=str} is overdue", task.name());
        Exit::Watchdog.now()
    }
}
