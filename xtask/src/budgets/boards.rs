//! What the proof of the stacks must be told of each controller's firmware: interrupts, executors, and where calls through
//! registers lead. Parts of the linker's names stand for functions.

use super::executors::{Level, Levels, TASKS, polls};
use super::stack::{Reach, Rule};

const WAKERS: &str = "embassy_executor3raw5waker";
const CHANNELS: &str = "DynamicChannel$LT$T$GT$$GT$";
const LOG: &str = "defmt_rtt7channel";

/// Tasks, by what they alone call.
const SAMPLE: Reach = Reach::Calling(TASKS, "AnalogState7observe");
const ESTIMATE: Reach = Reach::Calling(TASKS, "controller8estimate4turn");
const PUBLISH: Reach = Reach::Calling(TASKS, "j19396signal6Signal");
const SUPERVISE: Reach = Reach::Calling(TASKS, "Supervisor4look");

/// Storage and calibration call through objects.
const STORE_ITEM: Rule =
    Rule { of: &["store_item_inner"], reach: &[Reach::Named("map..Value$GT$14serialize_into")] };
const FILL: Rule = Rule {
    of: &["map..Value$GT$14serialize_into"],
    reach: &[Reach::Named("storage..framing..Fill$GT$4fill")],
};
const PLACE: Rule = Rule { of: &["active8prepared"], reach: &[Reach::Named("active..ParamsSlot$GT$4make")] };

/// NUCLEO-G474RE: thread for the store, executors in interrupts of peripherals that are not used.
pub const G474: Levels = Levels {
    rules: &[
        Rule { of: &["thread8Executor3run"], reach: &[Reach::Named(TASKS)] },
        Rule { of: &[CHANNELS], reach: &[Reach::Named(WAKERS)] },
        Rule { of: &["_defmt_acquire", "_defmt_release", "_defmt_write"], reach: &[Reach::Named(LOG)] },
        STORE_ITEM,
        FILL,
        PLACE,
        Rule { of: &["Channel9write_all"], reach: &[Reach::Named("blocking_write")] },
        Rule {
            of: &[
                TASKS,
                "controller8can_task",
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
    ],
    executors: &[
        Level {
            key: "g474_thread_stack_bytes",
            what: "G474 firmware: stack of the thread, static bound",
            entries: &["main"],
            polls: None,
        },
        Level {
            key: "g474_low_stack_bytes",
            what: "G474 firmware: stack of the executor of publish and supervise, static bound",
            entries: &["LPUART1"],
            polls: polls(G474_POLLS, &[PUBLISH, SUPERVISE]),
        },
        Level {
            key: "g474_estimate_stack_bytes",
            what: "G474 firmware: stack of the estimate's executor, static bound",
            entries: &["UART5"],
            polls: polls(G474_POLLS, &[ESTIMATE]),
        },
        Level {
            key: "g474_sample_stack_bytes",
            what: "G474 firmware: stack of the sampling's executor, static bound",
            entries: &["UART4"],
            polls: polls(G474_POLLS, &[SAMPLE]),
        },
    ],
    others: Level {
        key: "g474_interrupt_stack_bytes",
        what: "G474 firmware: stack of the other interrupts, static bound",
        entries: &["TIM2", "TIM5", "DMA1_CHANNEL1", "DMA1_CHANNEL2", "FDCAN1_IT0", "FDCAN1_IT1"],
        polls: None,
    },
    // Of damaged flash.
    above_all: &["NonMaskableInt"],
    sums: [
        ("g474_stack_bytes", "G474 firmware: all stacks and frames, static bound"),
        ("g474_ram_and_stack_bytes", "G474 firmware: static RAM and stack"),
    ],
};

/// What polls the tasks of an executor in an interrupt: the interrupt's handler, or a function that all such executors share.
const G474_POLLS: &[&str] = &["UART4", "UART5", "LPUART1", "InterruptExecutor12on_interrupt"];

/// The controller in QEMU's AN386: executors in interrupts 20 to 23, the thread idle. Its stack holds the exchange with the host, too.
pub const QEMU: Levels = Levels {
    rules: &[
        FILL,
        PLACE,
        // The flash's waiting is inlined there.
        Rule {
            of: &["sequential_storage"],
            reach: &[Reach::Named("map..Value$GT$14serialize_into"), Reach::Named(WAKERS)],
        },
        Rule {
            of: &[TASKS, "kou_app", "kou_qemu", "embassy_time", "embassy_sync"],
            reach: &[Reach::Named(WAKERS)],
        },
    ],
    executors: &[
        Level {
            key: "controller_thread_stack_bytes",
            what: "QEMU controller: stack of the thread (start), static bound",
            entries: &["main"],
            polls: None,
        },
        Level {
            key: "controller_lowest_stack_bytes",
            what: "QEMU controller: stack of the store's executor, static bound",
            entries: &["priority9on_lowest"],
            polls: polls(QEMU_POLLS, &[STORE]),
        },
        Level {
            key: "controller_low_stack_bytes",
            what: "QEMU controller: stack of the executor of publish and supervise, static bound",
            entries: &["priority6on_low17"],
            polls: polls(QEMU_POLLS, &[QEMU_PUBLISH, SUPERVISE]),
        },
        Level {
            key: "controller_estimate_stack_bytes",
            what: "QEMU controller: stack of the estimate's executor, static bound",
            entries: &["priority7on_high17"],
            polls: polls(QEMU_POLLS, &[ESTIMATE]),
        },
        Level {
            key: "controller_sample_stack_bytes",
            what: "QEMU controller: stack of the sampling's executor, static bound",
            entries: &["priority10on_highest"],
            polls: polls(QEMU_POLLS, &[SAMPLE]),
        },
    ],
    others: Level {
        key: "controller_interrupt_stack_bytes",
        what: "QEMU controller: stack of the other interrupts, static bound",
        entries: &["time7on_wrap", "time8on_alarm", "uart10on_receive"],
        polls: None,
    },
    above_all: &[],
    sums: [
        ("controller_stack_bytes", "QEMU controller: all stacks and frames, static bound"),
        ("controller_ram_and_stack_bytes", "QEMU controller: static RAM and stack"),
    ],
};

const QEMU_PUBLISH: Reach = Reach::Calling(TASKS, "j19394node4Node4poll");
const STORE: Reach = Reach::Calling(TASKS, "controller12storage_task");
const QEMU_POLLS: &[&str] = &["priority"];
