//! Worst-case stack of a controller's firmware: one stack, on which interrupts of rising priority stand above the thread.
//!
//! ```text
//! thread, frame, executor, frame, executor of higher priority, frame, ..., deepest of the other interrupts, frame,
//! what may interrupt even those
//! ```
//!
//! Each executor polls its tasks one after the other, so the deepest counts. The linker's names do not tell tasks apart, so a task
//! is known by what it calls. Which interrupts and executors there are, and where calls through registers lead, is told board
//! by board ([`super::boards`]); such a call without a rule is an error. Not counted: panics, and the writing of the note that a reset
//! leaves; nothing comes after them but the reset.

use std::path::Path;

use anyhow::Result;

use super::stack::{Program, Reach, Rule, frames};
use super::{Figure, figure};

/// Parts of the names of what an executor polls.
pub const TASKS: &str = "TaskStorage$LT$F$GT$4poll";

/// From here on nothing returns.
const ENDS: &[&str] =
    &["9panicking", "unwrap_failed", "expect_failed", "crash_log5write", "defmt_default_panic"];

/// Exception frame with the floating-point registers, and its alignment.
const FRAME: u32 = 26 * 4 + 4;
/// How many of the largest frames are told.
const LARGEST: usize = 40;

/// A firmware's stack, level by level.
pub struct Levels {
    /// Where calls through registers lead.
    pub rules: &'static [Rule],
    /// Thread and executors, from the lowest priority to the highest.
    pub executors: &'static [Level],
    /// All other interrupts, which have one priority.
    pub others: Level,
    /// What may interrupt even those.
    pub above_all: &'static [&'static str],
    /// Keys and meanings of all stacks together, and of them with the static RAM.
    pub sums: [(&'static str, &'static str); 2],
}

/// What shares one priority.
pub struct Level {
    /// Key of the figure.
    pub key: &'static str,
    /// Its meaning.
    pub what: &'static str,
    /// Functions that begin it: the linker's name, or a part of one function's.
    pub entries: &'static [&'static str],
    /// What the executor of this level polls.
    pub polls: Option<Rule>,
}

impl Level {
    fn depth(&self, program: &Program) -> Result<u32> {
        let mut deepest = 0;
        for entry in self.entries {
            deepest = deepest.max(program.depth_by(entry, self.polls.as_ref())?);
        }
        Ok(deepest)
    }
}

/// The way on which each level's stack is deepest, for people: what takes how much.
pub fn ways(elf: &Path, levels: &Levels) -> Result<String> {
    let program = Program::load(elf, levels.rules, ENDS, &[TASKS])?;
    let mut text = String::new();
    for level in levels.executors.iter().chain([&levels.others]) {
        for entry in level.entries {
            text += &program.told(entry, level.polls.as_ref())?;
        }
    }
    for entry in levels.above_all {
        text += &program.told(entry, None)?;
    }
    text += "\nlargest frames, wherever they are\n";
    text += &frames(&program.largest(LARGEST));
    Ok(text)
}

/// Stack of each level, of all together, and with the static RAM.
pub fn figures(elf: &Path, levels: &Levels, static_ram: u64) -> Result<Vec<Figure>> {
    let program = Program::load(elf, levels.rules, ENDS, &[TASKS])?;
    let mut figures = Vec::new();
    let mut stack = 0;
    for level in levels.executors.iter().chain([&levels.others]) {
        let depth = level.depth(&program)?;
        figures.push(figure(level.key, level.what, "bytes", depth.into()));
        // Whatever stands on the level below saves registers there first; the thread stands on nothing.
        stack += u64::from(depth) + if figures.len() > 1 { u64::from(FRAME) } else { 0 };
    }
    for entry in levels.above_all {
        stack += u64::from(program.depth_of(entry)? + FRAME);
    }
    let [all, with_ram] = levels.sums;
    figures.push(figure(all.0, all.1, "bytes", stack));
    figures.push(figure(with_ram.0, with_ram.1, "bytes", static_ram + stack));
    Ok(figures)
}

/// A rule of an interrupt's handler, or of a function that all executors in interrupts share: what is polled.
pub const fn polls(of: &'static [&'static str], reach: &'static [Reach]) -> Option<Rule> {
    Some(Rule { of, reach })
}
