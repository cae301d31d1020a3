//! Watchdog and crash handling: watchdog driver, reset cause, crash record across a reset, panics and hard faults.

use core::mem::MaybeUninit;
use core::panic::PanicInfo;

use cortex_m::peripheral::SCB;
use cortex_m_rt::{ExceptionFrame, exception};
use embassy_stm32::Peri;
use embassy_stm32::pac;
use embassy_stm32::peripherals::IWDG;
use embassy_stm32::wdg::IndependentWatchdog;
use kou_app::controller::{StartReason, Task, Watchdog};
use kou_app::diagnostics::ResetCause;
use kou_app::diagnostics::backtrace::{return_addresses, write_backtrace};
use kou_app::diagnostics::crash_log::{self, CrashKind, CrashText};

use crate::backtrace::{self, CodeFlash};

/// Period after which the watchdog resets the controller: ten periods of the task that feeds it.
const WATCHDOG_US: u32 = 500_000;

#[allow(unsafe_code, reason = "start-up must leave this memory alone, which its section says")]
#[unsafe(link_section = ".uninit.crash_record")]
static mut CRASH_RECORD: MaybeUninit<[u8; crash_log::LEN]> = MaybeUninit::uninit();

/// Exclusive access to the crash record's memory for the duration of a closure, with interrupts off.
fn with_crash_memory<R>(use_it: impl FnOnce(&mut [u8; crash_log::LEN]) -> R) -> R {
    critical_section::with(|_| {
        #[allow(unsafe_code, reason = "the only reference to the memory of the crash record")]
        // SAFETY: the single core runs this closure with interrupts off, and no other place names the static. Any bytes
        // are valid for an array of bytes; they come from before the reset, which the compiler cannot know, so the
        // address is hidden from it.
        let memory =
            unsafe { &mut *core::hint::black_box((&raw mut CRASH_RECORD).cast::<[u8; crash_log::LEN]>()) };
        use_it(memory)
    })
}

/// Driver of the independent watchdog.
pub(crate) struct WatchdogDriver {
    watchdog: IndependentWatchdog<'static, IWDG>,
}

impl WatchdogDriver {
    /// Starts the watchdog, which cannot be stopped again.
    pub(crate) fn new(iwdg: Peri<'static, IWDG>) -> Self {
        let mut watchdog = IndependentWatchdog::new(iwdg, WATCHDOG_US);
        watchdog.unleash();
        Self { watchdog }
    }
}

impl Watchdog for WatchdogDriver {
    fn feed(&mut self) {
        self.watchdog.pet();
    }

    fn give_up(&mut self, task: Task) {
        with_crash_memory(|memory| {
            crash_log::write(memory, CrashKind::Overdue, |text| {
                text.push(task.name());
            })
        });
    }
}

/// Reason of the present start, also logged; clears it in the hardware and in the crash record's memory.
pub(crate) fn begin() -> StartReason {
    let (has_survived, crash_record) =
        with_crash_memory(|memory| (crash_log::has_survived(memory), crash_log::take(memory)));
    let flags = pac::RCC.csr().read();
    pac::RCC.csr().modify(|csr| csr.set_rmvf(true));
    let cause = if flags.iwdgrstf() || flags.wwdgrstf() {
        ResetCause::Watchdog
    } else if flags.sftrstf() {
        ResetCause::Software
    } else if flags.borrstf() {
        // Set at every power-on as well: the supply has passed the brown-out threshold.
        crash_log::supply_reset(has_survived)
    } else if flags.pinrstf() {
        ResetCause::Pin
    } else {
        ResetCause::Unknown
    };
    defmt::info!("started by {}", cause);
    if let Some(crash) = &crash_record {
        defmt::warn!("before the reset: {}, {=str}", crash.kind, crash.text.as_str());
    }
    StartReason { cause, crash_record }
}

/// Writes a crash record and resets.
pub(crate) fn stop(why: &str) -> ! {
    crash(CrashKind::Panic, |text| {
        text.push(why);
    })
}

fn crash(kind: CrashKind, describe: impl FnOnce(&mut CrashText<'_>)) -> ! {
    cortex_m::interrupt::disable();
    with_crash_memory(|memory| crash_log::write(memory, kind, describe));
    SCB::sys_reset()
}

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    // Backtrace only: texts and locations of all panics would take 8 KB of flash.
    crash(CrashKind::Panic, |text| write_backtrace(text, return_addresses(&CodeFlash, backtrace::stack())))
}

#[allow(unsafe_code, reason = "an exception handler for hard faults must be declared unsafe")]
#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    crash(CrashKind::HardFault, |text| {
        text.push("at ").push_hex(frame.pc()).push(", ");
        write_backtrace(
            text,
            [frame.lr()].into_iter().chain(return_addresses(&CodeFlash, backtrace::stack())),
        )
    })
}
