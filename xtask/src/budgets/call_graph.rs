//! Call graph of a linked binary, from its machine code, and worst-case stack depth along its paths.
//!
//! A function's frame is the sum of all that its instructions push; its depth is the frame plus the deepest of the functions that
//! it branches to. An upper bound: exclusive branches are added up, and a tail call counts as a call. Recursion, frames of
//! unknown size and calls through registers whose targets no [`CallRule`] names have no bound and are errors. Built for size, a
//! function that calls another one several times loads its address once and calls through the register; so every function
//! address among a function's constants counts as called by it. A function that calls both such addresses and others from
//! memory needs a rule for the latter.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use anyhow::{Context, Result, bail};
use object::{Object, ObjectSection, ObjectSymbol, SymbolKind};

use super::thumb::{StackEffect, decode};

/// A function of the binary.
#[derive(Debug, Default)]
struct LinkedFunction {
    name: String,
    frame: u32,
    calls: BTreeSet<u32>,
    /// It calls or jumps to addresses held in registers.
    indirect: bool,
    /// Constants among its code that may be function addresses.
    literals: BTreeSet<u32>,
    /// Reason that its frame has no bound.
    unbounded: Option<&'static str>,
}

/// Stack depth from a function on, and the call that reaches it.
#[derive(Debug, Clone, Copy)]
struct DeepestPath {
    depth: u32,
    next: Option<u32>,
}

/// Targets of calls through registers, by parts of the linker's names.
#[derive(Debug, Clone, Copy)]
pub struct CallRule {
    /// Functions that make such calls; the first rule that names one applies.
    pub callers: &'static [&'static str],
    /// All functions that they may call.
    pub callees: &'static [Callee],
}

/// Functions that a call through a register may lead to.
#[derive(Debug, Clone, Copy)]
pub enum Callee {
    /// All whose name has this part.
    Named(&'static str),
    /// Those of them that call one whose name has the other part; there must be exactly one.
    Calling(&'static str, &'static str),
}

/// All functions by address, and what the binary does not say about their calls.
pub struct CallGraph {
    functions: BTreeMap<u32, LinkedFunction>,
    rules: &'static [CallRule],
    /// Functions, by parts of their names, that never return; their stack is not counted.
    diverging: &'static [&'static str],
    /// Functions, by parts of their names, whose address is passed on for others to call: only rules lead to them.
    callbacks: &'static [&'static str],
}

impl CallGraph {
    /// The deepest call path of a function with the frames on it, as a table for people.
    pub fn describe(&self, name: &str, first: Option<&CallRule>) -> Result<String> {
        let (depth, path) = (self.depth_with(name, first)?, self.call_path(name, first)?);
        Ok(format!("\n{name}: {depth} bytes\n{}", frames(&path)))
    }

    /// Reads a linked binary.
    pub fn load(
        elf: &Path,
        rules: &'static [CallRule],
        diverging: &'static [&'static str],
        callbacks: &'static [&'static str],
    ) -> Result<Self> {
        let bytes = std::fs::read(elf).with_context(|| format!("reading {}", elf.display()))?;
        let functions = Self::read(&bytes).with_context(|| format!("reading {}", elf.display()))?;
        Ok(Self { functions, rules, diverging, callbacks })
    }

    fn read(bytes: &[u8]) -> Result<BTreeMap<u32, LinkedFunction>> {
        let file = object::File::parse(bytes)?;
        // Arm's mapping symbols: $t begins code, $d data (literal pools and jump tables) within a section.
        let mapping: BTreeMap<u32, bool> = file
            .symbols()
            .filter_map(|symbol| {
                let name = symbol.name().ok()?;
                let code = name.starts_with("$t");
                (code || name.starts_with("$d")).then_some((symbol.address() as u32, code))
            })
            .collect();
        let is_code = |address: u32| mapping.range(..=address).next_back().is_none_or(|(_, code)| *code);

        let mut functions = BTreeMap::new();
        for symbol in file.symbols().filter(|symbol| symbol.kind() == SymbolKind::Text && symbol.size() > 0) {
            // Bit 0 of a function's address says Thumb.
            let start = symbol.address() as u32 & !1;
            let end = start + symbol.size() as u32;
            let Some(index) = symbol.section_index() else { continue };
            let section = file.section_by_index(index)?;
            let offset = (start - section.address() as u32) as usize;
            let body = section.data()?.get(offset..offset + (end - start) as usize);
            let body =
                body.with_context(|| format!("`{}` leaves its section", symbol.name().unwrap_or("?")))?;
            let name = symbol.name()?.to_owned();
            functions.insert(start, LinkedFunction::of(name, start, body, is_code));
        }
        Ok(functions)
    }

    /// Deepest stack of a function and all that it calls.
    pub fn depth_of(&self, name: &str) -> Result<u32> {
        self.depth_with(name, None)
    }

    /// The same with a rule before all others.
    pub fn depth_with(&self, name: &str, first: Option<&CallRule>) -> Result<u32> {
        Ok(self.paths_from(name, first)?.1.depth)
    }

    /// The deepest call path of a function: name and frame of each function on it.
    pub fn call_path(&self, name: &str, first: Option<&CallRule>) -> Result<Vec<(&str, u32)>> {
        let (known, mut deepest) = self.paths_from(name, first)?;
        let mut path = Vec::new();
        let (mut at, _) = self.start_of(name)?;
        while let Some(function) = self.functions.get(&at) {
            path.push((function.name.as_str(), function.frame));
            match deepest.next {
                Some(next) => {
                    (at, deepest) = (next, *known.get(&next).context("a path that was not walked")?)
                }
                None => break,
            }
        }
        Ok(path)
    }

    /// The functions with the largest frames of their own, largest first.
    pub fn largest(&self, count: usize) -> Vec<(&str, u32)> {
        let mut all: Vec<_> =
            self.functions.values().map(|function| (function.name.as_str(), function.frame)).collect();
        all.sort_by_key(|(_, frame)| std::cmp::Reverse(*frame));
        all.truncate(count);
        all
    }

    fn start_of(&self, name: &str) -> Result<(u32, &LinkedFunction)> {
        let found = self.functions.iter().find(|(_, function)| function.name == name);
        let by_part = || {
            let mut named = self.functions.iter().filter(|(_, function)| function.name.contains(name));
            named.next().filter(|_| named.next().is_none())
        };
        found
            .or_else(by_part)
            .map(|(at, function)| (*at, function))
            .with_context(|| format!("not exactly one function of the binary is named `{name}`"))
    }

    fn paths_from(
        &self,
        name: &str,
        first: Option<&CallRule>,
    ) -> Result<(BTreeMap<u32, DeepestPath>, DeepestPath)> {
        let (start, _) = self.start_of(name)?;
        let mut path = Vec::new();
        let mut known = BTreeMap::new();
        let deepest = self.depth(start, first, &mut path, &mut known).with_context(|| {
            let names = path.iter().filter_map(|at| Some(self.functions.get(at)?.name.as_str()));
            format!("on the path {}", names.collect::<Vec<_>>().join(" > "))
        })?;
        Ok((known, deepest))
    }

    fn depth(
        &self,
        at: u32,
        first: Option<&CallRule>,
        path: &mut Vec<u32>,
        known: &mut BTreeMap<u32, DeepestPath>,
    ) -> Result<DeepestPath> {
        if let Some(deepest) = known.get(&at) {
            return Ok(*deepest);
        }
        let Some(function) = self.functions.get(&at) else {
            bail!("a branch to {at:#x} leads to no known function; stack depth has no bound")
        };
        if contains_any(&function.name, self.diverging) {
            return Ok(DeepestPath { depth: 0, next: None });
        }
        if let Some(why) = function.unbounded {
            bail!("`{}` {why}; stack depth has no bound", function.name);
        }
        if path.contains(&at) {
            bail!("`{}` calls itself; stack depth has no bound", function.name);
        }
        path.push(at);
        let mut deepest = DeepestPath { depth: 0, next: None };
        for call in function.calls.iter().copied().chain(self.reached_from(function, first)?) {
            let depth = self.depth(call, first, path, known)?.depth;
            if depth > deepest.depth {
                deepest = DeepestPath { depth, next: Some(call) };
            }
        }
        path.pop();
        deepest.depth += function.frame;
        known.insert(at, deepest);
        Ok(deepest)
    }
}

impl CallGraph {
    fn calls(&self, function: &LinkedFunction, part: &str) -> bool {
        let mut called = function.calls.iter().filter_map(|call| self.functions.get(call));
        called.any(|called| called.name.contains(part))
    }

    /// Functions that a function may call through registers.
    fn reached_from(&self, function: &LinkedFunction, first: Option<&CallRule>) -> Result<Vec<u32>> {
        if !function.indirect {
            return Ok(Vec::new());
        }
        let is_called = |at: &u32| {
            self.functions.get(at).is_some_and(|called| !contains_any(&called.name, self.callbacks))
        };
        let mut reached: Vec<u32> = function.literals.iter().copied().filter(is_called).collect();
        let rule =
            first.into_iter().chain(self.rules).find(|rule| contains_any(&function.name, rule.callers));
        if rule.is_none() && reached.is_empty() {
            bail!("`{}` calls through a register; stack depth has no bound", function.name)
        }
        for callee in rule.map_or(&[][..], |rule| rule.callees) {
            let (Callee::Named(part) | Callee::Calling(part, _)) = callee;
            let named = self.functions.iter().filter(|(_, other)| other.name.contains(part));
            let found: Vec<u32> = match callee {
                Callee::Named(_) => named.map(|(at, _)| *at).collect(),
                Callee::Calling(_, what) => {
                    named.filter(|(_, other)| self.calls(other, what)).map(|(at, _)| *at).collect()
                }
            };
            let is_unclear = matches!(callee, Callee::Calling(..)) && found.len() > 1;
            if found.is_empty() || is_unclear {
                bail!("{} functions are {callee:?}, which `{}` should reach", found.len(), function.name);
            }
            reached.extend(found);
        }
        Ok(reached)
    }
}

/// A line for each function: its frame and its name.
pub fn frames(functions: &[(&str, u32)]) -> String {
    let line = |(name, frame): &(&str, u32)| format!("{frame:>8}  {:#}\n", rustc_demangle::demangle(name));
    functions.iter().map(line).collect()
}

fn contains_any(name: &str, parts: &[&str]) -> bool {
    parts.iter().any(|part| name.contains(part))
}

impl LinkedFunction {
    fn of(name: String, start: u32, body: &[u8], is_code: impl Fn(u32) -> bool) -> Self {
        let mut function = Self { name, ..Self::default() };
        let own = start..start + body.len() as u32;
        let mut offset = 0;
        while offset < body.len() {
            let address = start + offset as u32;
            if !is_code(address) {
                let word = body.get(offset..offset + 4).and_then(|word| word.try_into().ok());
                let word = word.map_or(0, u32::from_le_bytes);
                if address.is_multiple_of(4) && word & 1 == 1 {
                    function.literals.insert(word & !1);
                }
                offset += 2;
                continue;
            }
            let Some((length, effect)) = body.get(offset..).and_then(|rest| decode(rest, address)) else {
                break;
            };
            match effect {
                StackEffect::None => {}
                StackEffect::Pushes(bytes) => function.frame += bytes,
                StackEffect::PushesUnknown => function.unbounded = Some("pushes an unknown amount of stack"),
                StackEffect::Branches(to) if own.contains(&to) => {}
                StackEffect::Branches(to) | StackEffect::Calls(to) => {
                    function.calls.insert(to);
                }
                StackEffect::BranchesUnknown => function.indirect = true,
            }
            offset += length;
        }
        function
    }
}

#[cfg(test)]
mod tests;
