//! Worst-case stack of a controller's firmware: one stack, shared by the thread and by nested interrupts of rising priority.
//!
//! ```text
//! thread, frame, executor, frame, executor of higher priority, frame, ..., deepest of the other interrupts, frame,
//! what may interrupt even those
//! ```
//!
//! Each executor polls its tasks one after the other, so the deepest task counts. The linker's names do not distinguish
//! tasks; a task is identified by a function that it alone calls. Interrupts, executors and the targets of calls through
//! registers are listed for each board ([`super::boards`]); such a call without a rule is an error. Not counted: panics and
//! the crash record that they write; only a reset follows them.

use std::path::Path;

use anyhow::Result;

use super::call_graph::{CallGraph, CallRule, Callee, frames};
use super::figure::{Figure, bytes};

/// Parts of the names of what an executor polls.
pub const TASKS: &str = "TaskStorage$LT$F$GT$4poll";

/// Parts of the names of functions that never return.
const DIVERGING: &[&str] =
    &["9panicking", "unwrap_failed", "expect_failed", "crash_log5write", "defmt_default_panic"];

/// Exception frame with the floating-point registers, and its alignment.
const FRAME: u32 = 26 * 4 + 4;
/// Number of the largest frames to report.
const LARGEST: usize = 40;

/// The stack of a firmware, by priority level.
pub struct StackLevels {
    /// Targets of calls through registers.
    pub rules: &'static [CallRule],
    /// Thread and executors, in rising priority.
    pub executors: &'static [StackLevel],
    /// All other interrupts, which share one priority.
    pub others: StackLevel,
    /// Exceptions that may interrupt even those.
    pub above_all: &'static [&'static str],
    /// Keys and meanings of two sums: all stacks, and all stacks with the static RAM.
    pub sums: [(&'static str, &'static str); 2],
}

/// Code that runs at one priority.
pub struct StackLevel {
    /// Key of its figure.
    pub key: &'static str,
    /// Its meaning.
    pub what: &'static str,
    /// Entry functions: the linker's name, or a part that no other name has.
    pub entries: &'static [&'static str],
    /// Tasks that the executor of this level polls.
    pub polls: Option<CallRule>,
}

impl StackLevel {
    fn depth(&self, graph: &CallGraph) -> Result<u32> {
        let mut deepest = 0;
        for entry in self.entries {
            deepest = deepest.max(graph.depth_with(entry, self.polls.as_ref())?);
        }
        Ok(deepest)
    }
}

/// The deepest call path of each level, as a table for people.
pub fn call_paths(elf: &Path, levels: &StackLevels) -> Result<String> {
    let graph = CallGraph::load(elf, levels.rules, DIVERGING, &[TASKS])?;
    let mut text = String::new();
    for level in levels.executors.iter().chain([&levels.others]) {
        for entry in level.entries {
            text += &graph.describe(entry, level.polls.as_ref())?;
        }
    }
    for entry in levels.above_all {
        text += &graph.describe(entry, None)?;
    }
    text += "\nlargest frames, wherever they are\n";
    text += &frames(&graph.largest(LARGEST));
    Ok(text)
}

/// Stack of each level, their sum, and the sum with the static RAM.
pub fn figures(elf: &Path, levels: &StackLevels, static_ram: u64) -> Result<Vec<Figure>> {
    let graph = CallGraph::load(elf, levels.rules, DIVERGING, &[TASKS])?;
    let mut figures = Vec::new();
    let mut stack = 0;
    for level in levels.executors.iter().chain([&levels.others]) {
        let depth = level.depth(&graph)?;
        figures.push(bytes(level.key, level.what, depth.into()));
        // An interrupt first stacks its frame on the level below; the thread is the lowest level.
        stack += u64::from(depth) + if figures.len() > 1 { u64::from(FRAME) } else { 0 };
    }
    for entry in levels.above_all {
        stack += u64::from(graph.depth_of(entry)? + FRAME);
    }
    let [all, with_ram] = levels.sums;
    figures.push(bytes(all.0, all.1, stack));
    figures.push(bytes(with_ram.0, with_ram.1, static_ram + stack));
    Ok(figures)
}

/// The rule of an interrupt handler, or of a function that all interrupt executors share: the tasks that it polls.
pub const fn polls(callers: &'static [&'static str], callees: &'static [Callee]) -> Option<CallRule> {
    Some(CallRule { callers, callees })
}
