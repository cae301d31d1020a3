//! Interrupts, executors and targets of calls through registers of each controller's firmware. Functions are given by parts of
//! the linker's names.

use super::call_graph::{CallRule, Callee};
use super::executors::{StackLevel, StackLevels, TASKS, polls};

const WAKERS: &str = "embassy_executor3raw5waker";
const CHANNELS: &str = "DynamicChannel$LT$T$GT$$GT$";
const LOG: &str = "defmt_rtt7channel";

/// Tasks, by a function that only they call.
const SAMPLE: Callee = Callee::Calling(TASKS, "AnalogState7observe");
const ESTIMATE: Callee = Callee::Calling(TASKS, "controller8estimate5cycle");
const PUBLISH: Callee = Callee::Calling(TASKS, "j19396signal6Signal");
const SUPERVISE: Callee = Callee::Calling(TASKS, "Supervisor5check");

/// Calls of storage and calibration through trait objects.
const STORE_ITEM: CallRule =
    CallRule { callers: &["store_item_inner"], callees: &[Callee::Named("map..Value$GT$14serialize_into")] };
const FILL: CallRule = CallRule {
    callers: &["map..Value$GT$14serialize_into"],
    callees: &[Callee::Named("storage..framing..WriteBody$GT$10write_body")],
};
const PLACE: CallRule =
    CallRule { callers: &["active7prepare"], callees: &[Callee::Named("active..ParamsSlot$GT$4make")] };

/// NUCLEO-G474RE: thread for the store, executors in the interrupts of unused peripherals.
pub const G474: StackLevels = StackLevels {
    rules: &[
        CallRule { callers: &["thread8Executor3run"], callees: &[Callee::Named(TASKS)] },
        CallRule { callers: &[CHANNELS], callees: &[Callee::Named(WAKERS)] },
        CallRule {
            callers: &["_defmt_acquire", "_defmt_release", "_defmt_write"],
            callees: &[Callee::Named(LOG)],
        },
        STORE_ITEM,
        FILL,
        PLACE,
        CallRule { callers: &["Channel9write_all"], callees: &[Callee::Named("blocking_write")] },
        CallRule {
            callers: &[
                TASKS,
                "controller8can_task",
                "FDCAN1_IT0",
                "RxMode12on_interrupt",
                "drop_in_place$LT$embassy_sync",
                "g474re9publisher",
            ],
            callees: &[Callee::Named(WAKERS), Callee::Named(CHANNELS)],
        },
        CallRule {
            callers: &[
                "TIM5",
                "embassy_time_schedule_wake",
                "dma_bdma",
                "adjust_reference_counter",
                "next_expiration",
                "embassy_sync9waitqueue",
            ],
            callees: &[Callee::Named(WAKERS)],
        },
    ],
    executors: &[
        StackLevel {
            key: "g474_thread_stack_bytes",
            what: "G474 firmware: stack of the thread, static bound",
            entries: &["main"],
            polls: None,
        },
        StackLevel {
            key: "g474_low_stack_bytes",
            what: "G474 firmware: stack of the executor of publish and supervise, static bound",
            entries: &["LPUART1"],
            polls: polls(G474_POLLS, &[PUBLISH, SUPERVISE]),
        },
        StackLevel {
            key: "g474_estimate_stack_bytes",
            what: "G474 firmware: stack of the estimate's executor, static bound",
            entries: &["UART5"],
            polls: polls(G474_POLLS, &[ESTIMATE]),
        },
        StackLevel {
            key: "g474_sample_stack_bytes",
            what: "G474 firmware: stack of the sampling's executor, static bound",
            entries: &["UART4"],
            polls: polls(G474_POLLS, &[SAMPLE]),
        },
    ],
    others: StackLevel {
        key: "g474_interrupt_stack_bytes",
        what: "G474 firmware: stack of the other interrupts, static bound",
        entries: &["TIM2", "TIM5", "DMA1_CHANNEL1", "DMA1_CHANNEL2", "FDCAN1_IT0", "FDCAN1_IT1"],
        polls: None,
    },
    // Uncorrectable error of the flash.
    above_all: &["NonMaskableInt"],
    sums: [
        ("g474_stack_bytes", "G474 firmware: all stacks and frames, static bound"),
        ("g474_ram_and_stack_bytes", "G474 firmware: static RAM and stack"),
    ],
};

/// Functions that poll the tasks of an interrupt executor: the handler, or a function that all such executors share.
const G474_POLLS: &[&str] = &["UART4", "UART5", "LPUART1", "InterruptExecutor12on_interrupt"];

/// The controller on QEMU's AN386: executors in interrupts 20 to 23, the thread idle. Its stack includes the link to the host.
pub const QEMU: StackLevels = StackLevels {
    rules: &[
        FILL,
        PLACE,
        // Waiting for the flash is inlined there.
        CallRule {
            callers: &["sequential_storage"],
            callees: &[Callee::Named("map..Value$GT$14serialize_into"), Callee::Named(WAKERS)],
        },
        CallRule {
            callers: &[TASKS, "kou_app", "kou_qemu", "embassy_time", "embassy_sync"],
            callees: &[Callee::Named(WAKERS)],
        },
    ],
    executors: &[
        StackLevel {
            key: "controller_thread_stack_bytes",
            what: "QEMU controller: stack of the thread (start), static bound",
            entries: &["main"],
            polls: None,
        },
        StackLevel {
            key: "controller_lowest_stack_bytes",
            what: "QEMU controller: stack of the store's executor, static bound",
            entries: &["priority9on_lowest"],
            polls: polls(QEMU_POLLS, &[STORE]),
        },
        StackLevel {
            key: "controller_low_stack_bytes",
            what: "QEMU controller: stack of the executor of publish and supervise, static bound",
            entries: &["priority6on_low17"],
            polls: polls(QEMU_POLLS, &[QEMU_PUBLISH, SUPERVISE]),
        },
        StackLevel {
            key: "controller_estimate_stack_bytes",
            what: "QEMU controller: stack of the estimate's executor, static bound",
            entries: &["priority7on_high17"],
            polls: polls(QEMU_POLLS, &[ESTIMATE]),
        },
        StackLevel {
            key: "controller_sample_stack_bytes",
            what: "QEMU controller: stack of the sampling's executor, static bound",
            entries: &["priority10on_highest"],
            polls: polls(QEMU_POLLS, &[SAMPLE]),
        },
    ],
    others: StackLevel {
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

const QEMU_PUBLISH: Callee = Callee::Calling(TASKS, "j19394node4Node4poll");
const STORE: Callee = Callee::Calling(TASKS, "controller12storage_task");
const QEMU_POLLS: &[&str] = &["priority"];
