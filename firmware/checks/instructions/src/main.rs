//! Instructions of the estimator on a Cortex-M4F, and the sizes of its types there.
//!
//! Runs in QEMU (`cargo xtask budgets` starts it with the arguments that [`counter`] needs) and prints lines of
//! `name value` for xtask to read. Counts are of executed instructions, not cycles: QEMU has no pipeline. A figure is
//! every instruction of the function from its first to its return, both included: saving registers, loading coefficients
//! and storing results too. Not included are the caller's branch to it and the loading of its arguments.
#![no_std]
#![no_main]

mod counter;

use core::arch::naked_asm;
use core::hint::black_box;
use core::mem::size_of;
use core::panic::PanicInfo;

use cortex_m_rt::{ExceptionFrame, entry, exception};
use cortex_m_semihosting::debug::{self, EXIT_FAILURE, EXIT_SUCCESS};
use cortex_m_semihosting::{heprintln, hprintln};
use kou_estimator::model::flow_balance::OperatingPoint;
use kou_estimator::model::leakage_law::Law;
use kou_estimator::units::{Celsius, LeakageCoefficient, Megapascal, Micros, Ratio, RevPerMin};
use kou_estimator::{Calibration, Estimate, Params, Reason, Sample, State, step};
use kou_fixture::{
    MixedSamples, PlateauSamples, flow_meter_rig, short_blocks, typical_point, typical_sample,
};

use counter::{instructions, ticks};

/// Random samples of each machine over which the worst step is sought.
const SAMPLES: usize = 4000;
/// Samples of a drive over which it is sought as well: until a change has been found and its causes judged.
const DRIVING: usize = 12_000;

/// The empty function that is counted in place of each of the others: its return, and nothing else.
#[allow(unsafe_code, reason = "the compiler would give an empty function a stack frame")]
#[unsafe(naked)]
extern "C" fn nothing() {
    naked_asm!("bx lr")
}

/// Instructions of [`nothing`].
const NOTHING: u32 = 1;

/// [`nothing`] under the signature of another function.
macro_rules! nothing_as {
    ($signature:ty) => {{
        #[allow(unsafe_code, reason = "see SAFETY")]
        // SAFETY: a function that returns at once honours every signature of the C calling convention whose result is
        // a plain number in a register (any bits are one) or nothing.
        let f = unsafe { core::mem::transmute::<extern "C" fn(), $signature>(nothing) };
        black_box(f)
    }};
}

type LawFn = extern "C" fn(&Law, RevPerMin, Megapascal, Celsius) -> LeakageCoefficient;

/// The law alone: normalise, evaluate.
#[inline(never)]
extern "C" fn law(law: &Law, n_p: RevPerMin, p_h: Megapascal, t_b: Celsius) -> LeakageCoefficient {
    law.evaluate(law.normalised(n_p, p_h, t_b))
}

/// Results of law, forward model and inverse at one operating point.
#[derive(Clone, Copy)]
struct Chain {
    expected: LeakageCoefficient,
    ratio: Ratio,
    seen: LeakageCoefficient,
}

type ChainFn = extern "C" fn(&Params, &OperatingPoint, Ratio, &mut Chain);

/// Law, flow balance, speed ratio by the law, leakage coefficient by the measured ratio.
#[inline(never)]
extern "C" fn chain(params: &Params, at: &OperatingPoint, measured: Ratio, out: &mut Chain) {
    let law = params.law();
    let expected = law.evaluate(law.normalised(at.pump_speed, at.high_pressure, at.oil_temperature));
    let balance = params.reduced().balance(at);
    *out = Chain { expected, ratio: balance.ratio(expected), seen: balance.kou(measured) };
}

type StepFn = extern "C" fn(&Params, &mut State, &Sample, &mut Estimate);

/// A whole step, as the firmware calls it.
#[inline(never)]
extern "C" fn whole_step(params: &Params, state: &mut State, sample: &Sample, out: &mut Estimate) {
    *out = step(params, state, sample);
}

/// Instructions of a function from its ticks and those of [`nothing`] in its place.
fn counted(ticks: u32, ticks_nothing: u32) -> u32 {
    instructions(ticks, ticks_nothing) + NOTHING
}

/// Ticks of a law; the arguments are opaque to the optimiser, and the result is used.
#[inline(never)]
fn law_ticks(f: LawFn, l: &Law, at: &OperatingPoint) -> u32 {
    let (n_p, p_h, t_b) = black_box((at.pump_speed, at.high_pressure, at.oil_temperature));
    let mut kou = LeakageCoefficient(0.0);
    let taken = ticks(|| kou = f(l, n_p, p_h, t_b));
    black_box(kou);
    taken
}

#[inline(never)]
fn chain_ticks(f: ChainFn, params: &Params, at: &OperatingPoint, out: &mut Chain) -> u32 {
    let measured = black_box(Ratio(0.917));
    let taken = ticks(|| f(params, at, measured, out));
    black_box(out);
    taken
}

#[inline(never)]
fn step_ticks(f: StepFn, params: &Params, state: &mut State, sample: &Sample, out: &mut Estimate) -> u32 {
    let taken = ticks(|| f(params, state, sample, out));
    black_box(out);
    taken
}

/// Instructions of one step, after which `state` and `out` are those of the real one.
fn step_instructions(params: &Params, state: &mut State, sample: &Sample, out: &mut Estimate) -> u32 {
    let empty = step_ticks(nothing_as!(StepFn), params, state, sample, out);
    counted(step_ticks(black_box(whole_step), params, state, sample, out), empty)
}

/// The dearest step over the samples, and how many of the samples were valid.
fn worst_step(params: &Params) -> (u32, u32) {
    let mut state = State::new();
    (worst_of(params, &mut state, MixedSamples::new().take(SAMPLES)), state.valid())
}

/// The dearest step over a drive in which a change is found and its causes are judged.
fn worst_of_driving(params: &Params) -> u32 {
    let mut state = State::new();
    let worst = worst_of(params, &mut state, PlateauSamples::new().take(DRIVING));
    if state.health().last_change().is_none() {
        heprintln!("no change was found in the drive, so its worst step means nothing");
        fail();
    }
    worst
}

fn worst_of(params: &Params, state: &mut State, samples: impl Iterator<Item = Sample>) -> u32 {
    let mut out = Estimate::invalid(Micros(0), Reason::NotLoaded);
    let count = |sample| step_instructions(params, state, black_box(&sample), &mut out);
    samples.map(count).max().unwrap_or(0)
}

fn params(calibration: &Calibration) -> Params {
    match Params::new(calibration) {
        Ok(params) => params,
        Err(error) => {
            heprintln!("the fixture's calibration is refused: {}", error);
            fail()
        }
    }
}

#[entry]
fn main() -> ! {
    counter::start();
    let drive = black_box(params(&short_blocks()));
    let rig = black_box(params(&flow_meter_rig()));
    let at = black_box(typical_point());

    let empty = law_ticks(nothing_as!(LawFn), drive.law(), &at);
    hprintln!("law_instructions {}", counted(law_ticks(black_box(law), drive.law(), &at), empty));

    let mut both =
        Chain { expected: LeakageCoefficient(0.0), ratio: Ratio(0.0), seen: LeakageCoefficient(0.0) };
    let empty = chain_ticks(nothing_as!(ChainFn), &drive, &at, &mut both);
    let count = counted(chain_ticks(black_box(chain), &drive, &at, &mut both), empty);
    hprintln!("law_forward_inverse_instructions {}", count);
    black_box((both.expected, both.ratio, both.seen));

    let mut state = State::new();
    let mut out = Estimate::invalid(Micros(0), Reason::NotLoaded);
    let sample = black_box(typical_sample(Micros(1_000_000)));
    hprintln!("step_typical_instructions {}", step_instructions(&drive, &mut state, &sample, &mut out));
    if out.expected.is_err() || out.observed.is_err() {
        heprintln!("the typical sample is not valid, so its count means nothing");
        fail();
    }

    let (worst_of_drive, valid_of_drive) = worst_step(&drive);
    let (worst_of_rig, valid_of_rig) = worst_step(&rig);
    let driving = worst_of_driving(&drive).max(worst_of_driving(&rig));
    hprintln!("step_worst_instructions {}", worst_of_drive.max(worst_of_rig).max(driving));
    hprintln!("samples {}", 2 * SAMPLES);
    hprintln!("samples_valid {}", valid_of_drive + valid_of_rig);

    hprintln!("state_bytes {}", size_of::<State>());
    hprintln!("params_bytes {}", size_of::<Params>());
    hprintln!("sample_bytes {}", size_of::<Sample>());
    hprintln!("estimate_bytes {}", size_of::<Estimate>());
    hprintln!("calibration_bytes {}", size_of::<Calibration>());
    debug::exit(EXIT_SUCCESS);
    fail()
}

fn fail() -> ! {
    loop {
        debug::exit(EXIT_FAILURE);
    }
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    heprintln!("{}", info);
    fail()
}

#[exception]
#[allow(unsafe_code, reason = "cortex-m-rt demands an unsafe function")]
// SAFETY: called by the vector table only; it reads nothing but its frame.
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    heprintln!("{:?}", frame);
    fail()
}
