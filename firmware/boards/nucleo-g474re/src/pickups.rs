//! Pickups: timer 2 counts at 10 MHz in 32 bits and stamps every rising edge of its inputs 1 and 2.
//!
//! An interrupt reads each stamp: at 3000 r/min and 60 teeth one per 333 us and pickup. When an edge arrives before
//! the previous stamp was read, the timer reports an overrun and the speed measurement restarts. The timer filters
//! its inputs: an edge counts when the level has been stable for eight of its clocks.

use core::cell::RefCell;

use critical_section::Mutex;
use embassy_stm32::Peri;
use embassy_stm32::gpio::Pull;
use embassy_stm32::interrupt::typelevel::{self, Binding, Interrupt};
use embassy_stm32::pac;
use embassy_stm32::peripherals::{PA0, PA1, TIM2};
use embassy_stm32::time::Hertz;
use embassy_stm32::timer::input_capture::CapturePin;
use embassy_stm32::timer::low_level::{FilterValue, InputCaptureMode, InputTISelection, Timer};
use embassy_stm32::timer::{Ch1, Ch2, Channel};
use kou_app::controller::EdgeTimer;
use kou_app::sensors::pickup::Edges;

/// Rate of the counter, the same as in `kou_app::sensors::wiring`.
const COUNTER: Hertz = Hertz(10_000_000);
const CHANNELS: [Channel; 2] = [Channel::Ch1, Channel::Ch2];

/// Edges since the last read: pump, motor.
static EDGES: [Mutex<RefCell<Edges>>; 2] =
    [Mutex::new(RefCell::new(Edges::new())), Mutex::new(RefCell::new(Edges::new()))];

/// Both pickups.
pub(crate) struct Pickups {
    timer: Timer<'static, TIM2>,
    _pins: (CapturePin<'static, TIM2, Ch1>, CapturePin<'static, TIM2, Ch2>),
}

impl Pickups {
    /// Starts the timer.
    pub(crate) fn new(
        timer: Peri<'static, TIM2>,
        pump: Peri<'static, PA0>,
        motor: Peri<'static, PA1>,
        _irqs: impl Binding<typelevel::TIM2, Handler>,
    ) -> Self {
        let pins = (CapturePin::new(pump, Pull::Down), CapturePin::new(motor, Pull::Down));
        let mut timer = Timer::new(timer);
        timer.set_max_compare_value(u32::MAX);
        timer.set_tick_freq(COUNTER);
        for channel in CHANNELS {
            timer.set_input_ti_selection(channel, InputTISelection::Normal);
            timer.set_input_capture_filter(channel, FilterValue::FCK_INT_N8);
            timer.set_input_capture_mode(channel, InputCaptureMode::Rising);
            timer.enable_channel(channel, true);
            timer.enable_input_interrupt(channel, true);
        }
        #[allow(unsafe_code, reason = "enabling an interrupt can break a critical section based on masking")]
        // SAFETY: critical sections on this board disable interrupts altogether and mask none.
        unsafe {
            typelevel::TIM2::enable();
        }
        timer.start();
        Self { timer, _pins: pins }
    }
}

impl EdgeTimer for Pickups {
    fn take(&mut self, pump: &mut Edges, motor: &mut Edges) -> u32 {
        critical_section::with(|cs| {
            // An edge that arrives now would be stamped later than the count and lost: repeat until none has arrived
            // in between.
            let count = loop {
                capture();
                let count = pac::TIM2.cnt().read();
                if !CHANNELS.iter().any(|&channel| self.timer.get_input_interrupt(channel)) {
                    break count;
                }
            };
            for (edges, into) in EDGES.iter().zip([pump, motor]) {
                core::mem::swap(&mut *edges.borrow_ref_mut(cs), into);
                edges.borrow_ref_mut(cs).clear();
            }
            count
        })
    }
}

/// Reads the stamps of the timer.
fn capture() {
    critical_section::with(|cs| {
        for (channel, edges) in EDGES.iter().enumerate() {
            let status = pac::TIM2.sr().read();
            if !status.ccif(channel) {
                continue;
            }
            // Reading the stamp clears its flag.
            let stamp = pac::TIM2.ccr(channel).read();
            let mut edges = edges.borrow_ref_mut(cs);
            edges.push(stamp);
            if status.ccof(channel) {
                pac::TIM2.sr().modify(|sr| sr.set_ccof(channel, false));
                edges.overrun();
            }
        }
    });
}

/// Interrupt of timer 2.
pub(crate) struct Handler;

#[allow(unsafe_code, reason = "the trait of interrupt handlers is unsafe to call")]
impl typelevel::Handler<typelevel::TIM2> for Handler {
    unsafe fn on_interrupt() {
        capture();
    }
}
