//! The controller's hardware in QEMU: a converter and a timer whose other end is the host.
//!
//! Once in a millisecond, when the sampling task asks for the edges, one message goes to the host and one comes back; the
//! converter's transactions of that millisecond are in it already, because the task asks for the same inputs each time.
//! The driver still clocks its own bytes: a transaction that was not foreseen fails.
//!
//! The flash is the host's as well. Its operations are exchanged at once, with interrupts off, since both kinds of message
//! share the line; the time that the hardware would take is waited for afterwards, and other tasks run meanwhile, as they
//! would beside the second bank of an STM32G474.

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

/// Frames that a CAN controller's queues hold.
const CAN_QUEUE: usize = 16;
static TX_QUEUE: Mutex<RefCell<Deque<CanFrame, CAN_QUEUE>>> = Mutex::new(RefCell::new(Deque::new()));
static RX_QUEUE: Mutex<RefCell<Deque<CanFrame, CAN_QUEUE>>> = Mutex::new(RefCell::new(Deque::new()));

/// The CAN controller, whose bus the host emulates.
pub struct EmulatedCan(());

impl EmulatedCan {
    /// The controller.
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

/// The line to the host.
pub struct HostLine {
    from_host: File,
    to_host: File,
}

impl HostLine {
    /// Opens the line; the host opens its ends in the same order.
    ///
    /// # Errors
    /// When there is no such file: nobody is there.
    pub fn open() -> io::Result<Self> {
        Ok(Self { from_host: File::open(REQUESTS)?, to_host: File::create(RESPONSES)? })
    }

    /// The next message from the host, which is at most [`MAX_LEN`] bytes and comes in one piece.
    fn receive<'a>(&mut self, buffer: &'a mut [u8; MAX_LEN]) -> Option<&'a [u8]> {
        let length = self.from_host.read(buffer).ok().filter(|&length| length > 0)?;
        buffer.get(..length)
    }

    /// The message with which the host begins.
    pub fn begin<'a>(&mut self, buffer: &'a mut [u8; MAX_LEN]) -> Option<EmulationStart<'a>> {
        unpack(self.receive(buffer)?).map(|(begin, _)| begin)
    }

    /// Hands the line over to the timer and the flash, which share it.
    pub fn share(self) {
        critical_section::with(|cs| *LINE.borrow_ref_mut(cs) = Some(self));
    }
}

static LINE: Mutex<RefCell<Option<HostLine>>> = Mutex::new(RefCell::new(None));

/// One message out, one in. Interrupts are off meanwhile, and time stands still in the host's turn; packing and unpacking, which
/// take time, are left out of that.
fn ask<T: serde::de::DeserializeOwned>(said: &FirmwareMessage) -> Option<T> {
    let (mut out, mut back) = ([0; MAX_LEN], [0; MAX_LEN]);
    let bytes = pack(said, &mut out)?;
    let length = critical_section::with(|cs| {
        let mut line = LINE.borrow_ref_mut(cs);
        let line = line.as_mut()?;
        line.to_host.write_all(bytes).ok()?;
        line.receive(&mut back).map(<[u8]>::len)
    })?;
    unpack(back.get(..length)?).map(|(answer, _)| answer)
}

/// The flash, whose cells are the host's; reads are from a copy in RAM, at once, as from flash that lies in memory.
pub struct EmulatedFlash {
    writing: fn() -> Option<RecordKind>,
    copy: &'static mut [u8; FLASH_LEN],
}

static COPY: ConstStaticCell<[u8; FLASH_LEN]> = ConstStaticCell::new([0; FLASH_LEN]);

/// The host has refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, defmt::Format)]
pub struct EmulatedFlashError;

impl NorFlashError for EmulatedFlashError {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

/// Time that an STM32G474 takes for a word and for a page, as its data sheet says.
const WORD_TIME: Duration = Duration::from_micros(85);
const PAGE_TIME: Duration = Duration::from_millis(22);

impl EmulatedFlash {
    /// The flash, once, when the line is shared; `writing` says which record is being written, for the host to aim its power
    /// cuts at.
    #[must_use]
    pub fn new(writing: fn() -> Option<RecordKind>) -> Option<Self> {
        let mut flash = Self { writing, copy: COPY.try_take()? };
        flash.look(0..FLASH_LEN)?;
        Some(flash)
    }

    /// Copies what the host's cells hold.
    fn look(&mut self, range: Range<usize>) -> Option<()> {
        let offsets = range.clone().step_by(FLASH_CHUNK);
        for (offset, chunk) in offsets.zip(self.copy.get_mut(range)?.chunks_mut(FLASH_CHUNK)) {
            let length = u16::try_from(chunk.len()).ok()?;
            let work = FlashWork::Read { offset: u32::try_from(offset).ok()?, length };
            let read = ask::<FlashDone>(&FirmwareMessage::Flash { of: None, work })??;
            chunk.copy_from_slice(read.get(..chunk.len())?);
        }
        Some(())
    }

    fn work(&self, work: FlashWork) -> Result<Vec<u8, FLASH_CHUNK>, EmulatedFlashError> {
        let of = (self.writing)().map(|kind| kind as u8);
        let Some(done) = ask::<FlashDone>(&FirmwareMessage::Flash { of, work }) else { Exit::HostGone.now() };
        done.ok_or(EmulatedFlashError)
    }
}

impl FlashErrorType for EmulatedFlash {
    type Error = EmulatedFlashError;
}

impl ReadNorFlash for EmulatedFlash {
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

impl NorFlash for EmulatedFlash {
    const WRITE_SIZE: usize = ram_flash::WORD;
    const ERASE_SIZE: usize = FLASH_PAGE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), EmulatedFlashError> {
        self.work(FlashWork::Erase { from, to })?;
        self.look(from as usize..to as usize).ok_or(EmulatedFlashError)?;
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
            self.look(at..at.saturating_add(chunk.len())).ok_or(EmulatedFlashError)?;
            Timer::after(WORD_TIME * words).await;
        }
        Ok(())
    }
}

/// The key that the host gave.
pub struct HostKey(pub Option<[u8; 32]>);

impl KeySource for HostKey {
    fn update_key(&self) -> Option<Key> {
        self.0.map(Key::new)
    }
}

/// The stamping timer, and with it the exchange.
pub struct EmulatedTimer<F> {
    tick: u32,
    asks: Vec<[u8; 3], CHANNELS>,
    tell: F,
}

impl<F: FnMut(&mut TickReport)> EmulatedTimer<F> {
    /// A timer that asks the converter for `asks` each time, and lets `tell` fill in what else the host is told.
    pub fn new(asks: Vec<[u8; 3], CHANNELS>, tell: F) -> Self {
        Self { tick: 0, asks, tell }
    }

    fn exchange(&mut self) -> Option<TickReply> {
        let mut message = TickReport {
            tick: self.tick,
            spi: self.asks.clone(),
            output: None,
            sample: None,
            task_stats: None,
            stack_bytes: 0,
            fed: 0,
            writing: None,
            can: Vec::new(),
        };
        (self.tell)(&mut message);
        critical_section::with(|cs| {
            let mut sent = TX_QUEUE.borrow_ref_mut(cs);
            while let Some(frame) = sent.pop_front() {
                if let Err(frame) = message.can.push(frame) {
                    // There is room again: it was taken from there.
                    sent.push_front(frame).ok();
                    break;
                }
            }
        });
        ask(&FirmwareMessage::Tick(message))
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
            transactions.extend(self.asks.iter().copied().zip(answer.spi.iter().copied()));
            let mut come = RX_QUEUE.borrow_ref_mut(cs);
            for frame in answer.can {
                // A full queue loses the newest, as a CAN controller's does.
                come.push_back(frame).ok();
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

/// The converter's bus and chip select.
pub struct EmulatedSpi(());

impl EmulatedSpi {
    /// The bus.
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

/// A watchdog that ends the emulation when it is given up, and counts how often it was fed.
pub struct EmulatedWatchdog {
    fed: &'static core::sync::atomic::AtomicU32,
}

impl EmulatedWatchdog {
    /// Counts in `fed`.
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
