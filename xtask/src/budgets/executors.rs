//! Worst-case stack of the vehicle's firmware: one stack, on which interrupts of rising priority stand above the thread.
//!
//! ```text
//! thread executor, frame, executor of publish and supervise, frame, of the estimate, frame, of the sampling, frame,
//! deepest of the other interrupts, frame, interrupt of damaged flash
//! ```
//!
//! Each executor polls its tasks one after the other, so the deepest counts. The linker's names do not tell tasks apart, so the
//! tasks in interrupts are known by what they call, and the thread is charged with the deepest of all.
//! All other interrupts have one priority, so of them the deepest counts.
//!
//! Calls through registers are those of executors (to tasks), of wakers, of CAN's dynamic channels and of the log's
//! transport; a further one is an error until it has a rule. Not counted: panics, and the writing of the note that a
//! reset leaves; nothing comes after them but the reset.

use std::path::Path;

use anyhow::Result;

use super::stack::{Program, Reach, Rule, frames};
use super::{Figure, figure};

/// Parts of the names of what an executor polls.
const TASKS: &str = "TaskStorage$LT$F$GT$4poll";
const WAKERS: &str = "embassy_executor3raw5waker";
const CHANNELS: &str = "DynamicChannel$LT$T$GT$$GT$";
const LOG: &str = "defmt_rtt7channel";

const RULES: &[Rule] = &[
    Rule { of: &["thread8Executor3run"], reach: &[Reach::Named(TASKS)] },
    Rule { of: &[CHANNELS], reach: &[Reach::Named(WAKERS)] },
    Rule { of: &["_defmt_acquire", "_defmt_release", "_defmt_write"], reach: &[Reach::Named(LOG)] },
    Rule { of: &["store_item_inner"], reach: &[Reach::Named("map..Value$GT$14serialize_into")] },
    Rule {
        of: &["map..Value$GT$14serialize_into"],
        reach: &[Reach::Named("storage..record..Fill$GT$4fill")],
    },
    Rule { of: &["calibration8prepared"], reach: &[Reach::Named("calibration..Place$GT$4make")] },
    Rule { of: &["Channel9write_all"], reach: &[Reach::Named("blocking_write")] },
    Rule {
        of: &[
            TASKS,
            "controller3bus",
            "FDCAN1_IT0",
            "RxMode12on_interrupt",
            "drop_in_place$LT$embassy_sync",
            "g474re4told",
        ],
        reach: &[Reach::Named(WAKERS), Reach::Named(CHANNELS)],
    },
    Rule {
        of: &[
            "TIM5",
            "embassy_time_schedule_wake",
            "dma_bdma",
            "adjust_reference_counter",
            "next_expiration",
            "embassy_sync9waitqueue",
        ],
        reach: &[Reach::Named(WAKERS)],
    },
];

/// What polls the tasks of an executor in an interrupt: the interrupt's handler, or a function that all such executors share.
const POLLS: &[&str] = &["UART4", "UART5", "LPUART1", "InterruptExecutor12on_interrupt"];
const SAMPLE: Rule = Rule { of: POLLS, reach: &[Reach::Calling(TASKS, "AnalogState7observe")] };
const ESTIMATE: Rule = Rule { of: POLLS, reach: &[Reach::Calling(TASKS, "controller8estimate4turn")] };
const LOW: Rule = Rule {
    of: POLLS,
    reach: &[Reach::Calling(TASKS, "j19396signal6Signal"), Reach::Calling(TASKS, "Supervisor4look")],
};

/// From here on nothing returns.
const ENDS: &[&str] =
    &["9panicking", "unwrap_failed", "expect_failed", "controller4note5write", "defmt_default_panic"];

/// Exception frame with the floating-point registers, and its alignment.
const FRAME: u32 = 26 * 4 + 4;
/// Not maskable: it may stand on all others.
const DAMAGED_FLASH: &str = "NonMaskableInt";
/// How many of the largest frames are told.
const LARGEST: usize = 40;
/// Interrupts that are no executor's.
const INTERRUPTS: [&str; 6] = ["TIM2", "TIM5", "DMA1_CHANNEL1", "DMA1_CHANNEL2", "FDCAN1_IT0", "FDCAN1_IT1"];

/// The way on which each executor's stack is deepest, for people: what takes how much.
pub fn ways(elf: &Path) -> Result<String> {
    let program = Program::load(elf, RULES, ENDS, &[TASKS])?;
    let mut text = String::new();
    let executors =
        [("main", None), ("LPUART1", Some(&LOW)), ("UART5", Some(&ESTIMATE)), ("UART4", Some(&SAMPLE))];
    let others = INTERRUPTS.into_iter().chain([DAMAGED_FLASH]).map(|name| (name, None));
    for (name, rule) in executors.into_iter().chain(others) {
        text += &program.told(name, rule)?;
    }
    text += "\nlargest frames, wherever they are\n";
    text += &frames(&program.largest(LARGEST));
    Ok(text)
}

/// Stack of the thread, of the three executors in interrupts, of the other interrupts, all together, and with the static RAM.
pub fn figures(elf: &Path, static_ram: u64) -> Result<[Figure; 7]> {
    let program = Program::load(elf, RULES, ENDS, &[TASKS])?;
    let thread = program.depth_of("main")?;
    let estimate = program.depth_by("UART5", Some(&ESTIMATE))?;
    let sample = program.depth_by("UART4", Some(&SAMPLE))?;
    let low = program.depth_by("LPUART1", Some(&LOW))?;
    let mut others = 0;
    for name in INTERRUPTS {
        others = others.max(program.depth_of(name)?);
    }
    let above_all = program.depth_of(DAMAGED_FLASH)?;
    let stack = u64::from(thread + low + estimate + sample + others + above_all + 5 * FRAME);
    let bytes = |key, what, value| figure(key, what, "bytes", value);
    Ok([
        bytes("g474_thread_stack_bytes", "G474 firmware: stack of the thread, static bound", thread.into()),
        bytes(
            "g474_low_stack_bytes",
            "G474 firmware: stack of the executor of publish and supervise, static bound",
            low.into(),
        ),
        bytes(
            "g474_estimate_stack_bytes",
            "G474 firmware: stack of the estimate's executor, static bound",
            estimate.into(),
        ),
        bytes(
            "g474_sample_stack_bytes",
            "G474 firmware: stack of the sampling's executor, static bound",
            sample.into(),
        ),
        bytes(
            "g474_interrupt_stack_bytes",
            "G474 firmware: stack of the other interrupts, static bound",
            others.into(),
        ),
        bytes("g474_stack_bytes", "G474 firmware: all stacks and frames, static bound", stack),
        bytes("g474_ram_and_stack_bytes", "G474 firmware: static RAM and stack", static_ram + stack),
    ])
}
