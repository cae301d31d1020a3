//! Worst-case stack depth of the estimator's entry points, from the machine code of the linked binary.
//!
//! Every function's frame is the sum of all that its instructions take from the stack, its depth the frame plus the
//! deepest of the functions it branches to. An upper bound: branches that exclude each other are added up, and a tail
//! call counts as a call. Recursion, frames of unknown size and calls through registers whose targets no [`Rule`] names have
//! no bound and are errors. Built for size, a function that calls another one several times loads its address once and calls
//! through the register; so every address of a function among a function's constants is taken to be called by it. A function
//! that calls both such addresses and others from memory needs a rule for those; the linker cannot tell us.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use anyhow::{Context, Result, bail};
use object::{Object, ObjectSection, ObjectSymbol, SymbolKind};

use super::thumb::{Effect, decode};
use super::{Figure, figure};

/// A function of the binary.
#[derive(Debug, Default)]
struct Function {
    name: String,
    frame: u32,
    calls: BTreeSet<u32>,
    /// Whether it calls or jumps to addresses held in registers.
    indirect: bool,
    /// Constants among its code that may be addresses of functions.
    held: BTreeSet<u32>,
    /// Why there is no bound.
    unbounded: Option<&'static str>,
}

/// How deep the stack gets from a function on, and by which of its calls.
#[derive(Debug, Clone, Copy)]
struct Deepest {
    depth: u32,
    next: Option<u32>,
}

/// Where calls through registers lead, by parts of the linker's names.
#[derive(Debug, Clone, Copy)]
pub struct Rule {
    /// Functions that make such calls; the first rule that names one holds.
    pub of: &'static [&'static str],
    /// All functions that they may reach.
    pub reach: &'static [Reach],
}

/// Functions that a call through a register may reach.
#[derive(Debug, Clone, Copy)]
pub enum Reach {
    /// All whose name has this part.
    Named(&'static str),
    /// Those of them that call one whose name has the other part; there must be exactly one.
    Calling(&'static str, &'static str),
}

/// All functions by address.
pub struct Program {
    functions: BTreeMap<u32, Function>,
    rules: &'static [Rule],
    /// Functions, by parts of their names, that end the program and are not counted.
    ends: &'static [&'static str],
    /// Functions, by parts of their names, whose address is handed on to be called by somebody else: only rules lead to them.
    handed_on: &'static [&'static str],
}

/// The entry points that firmware calls.
pub fn estimator_figures(elf: &Path) -> Result<[Figure; 5]> {
    let program = Program::load(elf, &[], &[], &[])?;
    let depth = |name: &str| program.depth_of(name).map(u64::from);
    Ok([
        figure("step_stack_bytes", "step: stack, static bound", "bytes", depth("kou_step")?),
        figure(
            "params_new_stack_bytes",
            "Params::new: stack, static bound",
            "bytes",
            depth("kou_params_new")?,
        ),
        figure(
            "params_replace_stack_bytes",
            "Params::replace: stack, static bound",
            "bytes",
            depth("kou_params_replace")?,
        ),
        figure(
            "record_decode_stack_bytes",
            "record decode: stack, static bound",
            "bytes",
            depth("kou_record_decode")?,
        ),
        figure(
            "record_encode_stack_bytes",
            "record encode: stack, static bound",
            "bytes",
            depth("kou_record_encode")?,
        ),
    ])
}

/// Entry points of the estimator, as the check that links it alone names them.
const ENTRY_POINTS: [&str; 5] =
    ["kou_step", "kou_params_new", "kou_params_replace", "kou_record_decode", "kou_record_encode"];

/// The way on which the stack is deepest from each of the estimator's entry points, for people.
pub fn estimator_ways(elf: &Path) -> Result<String> {
    let program = Program::load(elf, &[], &[], &[])?;
    ENTRY_POINTS.iter().map(|name| program.told(name, None)).collect()
}

impl Program {
    /// The way on which a function's stack is deepest, for people: what takes how much.
    pub fn told(&self, name: &str, first: Option<&Rule>) -> Result<String> {
        let (depth, way) = (self.depth_by(name, first)?, self.way_by(name, first)?);
        Ok(format!("\n{name}: {depth} bytes\n{}", frames(&way)))
    }

    /// Reads a linked binary.
    pub fn load(
        elf: &Path,
        rules: &'static [Rule],
        ends: &'static [&'static str],
        handed_on: &'static [&'static str],
    ) -> Result<Self> {
        let bytes = std::fs::read(elf).with_context(|| format!("reading {}", elf.display()))?;
        let functions = Self::read(&bytes).with_context(|| format!("reading {}", elf.display()))?;
        Ok(Self { functions, rules, ends, handed_on })
    }

    fn read(bytes: &[u8]) -> Result<BTreeMap<u32, Function>> {
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
            functions.insert(start, Function::of(name, start, body, is_code));
        }
        Ok(functions)
    }

    /// Deepest stack of a function and all that it calls.
    pub fn depth_of(&self, name: &str) -> Result<u32> {
        self.depth_by(name, None)
    }

    /// The same where a rule comes before all others.
    pub fn depth_by(&self, name: &str, first: Option<&Rule>) -> Result<u32> {
        Ok(self.known_from(name, first)?.1.depth)
    }

    /// The way on which a function's stack is deepest: each function's name and frame.
    pub fn way_by(&self, name: &str, first: Option<&Rule>) -> Result<Vec<(&str, u32)>> {
        let (known, mut deepest) = self.known_from(name, first)?;
        let mut way = Vec::new();
        let (mut at, _) = self.start_of(name)?;
        while let Some(function) = self.functions.get(&at) {
            way.push((function.name.as_str(), function.frame));
            match deepest.next {
                Some(next) => (at, deepest) = (next, *known.get(&next).context("a way that was not walked")?),
                None => break,
            }
        }
        Ok(way)
    }

    /// The functions with the largest frames of their own, largest first.
    pub fn largest(&self, count: usize) -> Vec<(&str, u32)> {
        let mut all: Vec<_> =
            self.functions.values().map(|function| (function.name.as_str(), function.frame)).collect();
        all.sort_by_key(|(_, frame)| std::cmp::Reverse(*frame));
        all.truncate(count);
        all
    }

    fn start_of(&self, name: &str) -> Result<(u32, &Function)> {
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

    fn known_from(&self, name: &str, first: Option<&Rule>) -> Result<(BTreeMap<u32, Deepest>, Deepest)> {
        let (start, _) = self.start_of(name)?;
        let mut path = Vec::new();
        let mut known = BTreeMap::new();
        let deepest = self.depth(start, first, &mut path, &mut known).with_context(|| {
            let names = path.iter().filter_map(|at| Some(self.functions.get(at)?.name.as_str()));
            format!("on the way {}", names.collect::<Vec<_>>().join(" > "))
        })?;
        Ok((known, deepest))
    }

    fn depth(
        &self,
        at: u32,
        first: Option<&Rule>,
        path: &mut Vec<u32>,
        known: &mut BTreeMap<u32, Deepest>,
    ) -> Result<Deepest> {
        if let Some(deepest) = known.get(&at) {
            return Ok(*deepest);
        }
        let Some(function) = self.functions.get(&at) else {
            bail!("a branch to {at:#x} leads to no known function; stack depth has no bound")
        };
        if contains_any(&function.name, self.ends) {
            return Ok(Deepest { depth: 0, next: None });
        }
        if let Some(why) = function.unbounded {
            bail!("`{}` {why}; stack depth has no bound", function.name);
        }
        if path.contains(&at) {
            bail!("`{}` calls itself; stack depth has no bound", function.name);
        }
        path.push(at);
        let mut deepest = Deepest { depth: 0, next: None };
        for call in function.calls.iter().copied().chain(self.reached_from(function, first)?) {
            let depth = self.depth(call, first, path, known)?.depth;
            if depth > deepest.depth {
                deepest = Deepest { depth, next: Some(call) };
            }
        }
        path.pop();
        deepest.depth += function.frame;
        known.insert(at, deepest);
        Ok(deepest)
    }
}

impl Program {
    fn calls(&self, function: &Function, part: &str) -> bool {
        let mut called = function.calls.iter().filter_map(|call| self.functions.get(call));
        called.any(|called| called.name.contains(part))
    }

    /// Functions that one may call through registers.
    fn reached_from(&self, function: &Function, first: Option<&Rule>) -> Result<Vec<u32>> {
        if !function.indirect {
            return Ok(Vec::new());
        }
        let is_called =
            |at: &u32| self.functions.get(at).is_some_and(|held| !contains_any(&held.name, self.handed_on));
        let mut reached: Vec<u32> = function.held.iter().copied().filter(is_called).collect();
        let rule = first.into_iter().chain(self.rules).find(|rule| contains_any(&function.name, rule.of));
        if rule.is_none() && reached.is_empty() {
            bail!("`{}` calls through a register; stack depth has no bound", function.name)
        }
        for reach in rule.map_or(&[][..], |rule| rule.reach) {
            let (Reach::Named(part) | Reach::Calling(part, _)) = reach;
            let named = self.functions.iter().filter(|(_, other)| other.name.contains(part));
            let found: Vec<u32> = match reach {
                Reach::Named(_) => named.map(|(at, _)| *at).collect(),
                Reach::Calling(_, what) => {
                    named.filter(|(_, other)| self.calls(other, what)).map(|(at, _)| *at).collect()
                }
            };
            let is_unclear = matches!(reach, Reach::Calling(..)) && found.len() > 1;
            if found.is_empty() || is_unclear {
                bail!("{} functions are {reach:?}, which `{}` should reach", found.len(), function.name);
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

impl Function {
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
                    function.held.insert(word & !1);
                }
                offset += 2;
                continue;
            }
            let Some((length, effect)) = body.get(offset..).and_then(|rest| decode(rest, address)) else {
                break;
            };
            match effect {
                Effect::None => {}
                Effect::Takes(bytes) => function.frame += bytes,
                Effect::TakesUnknown => function.unbounded = Some("takes an unknown amount of stack"),
                Effect::Goes(to) if own.contains(&to) => {}
                Effect::Goes(to) | Effect::Calls(to) => {
                    function.calls.insert(to);
                }
                Effect::GoesUnknown => function.indirect = true,
            }
            offset += length;
        }
        function
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn program(functions: &[(u32, u32, &[u32])]) -> Program {
        let functions = functions.iter().map(|(at, frame, calls)| {
            let calls = calls.iter().copied().collect();
            (*at, Function { name: format!("f{at}"), frame: *frame, calls, ..Function::default() })
        });
        Program { functions: functions.collect(), rules: &[], ends: &[], handed_on: &[] }
    }

    #[test]
    fn depth_is_the_deepest_path() {
        let p = program(&[(0, 8, &[10, 20]), (10, 100, &[]), (20, 16, &[30]), (30, 96, &[])]);
        assert_eq!(p.depth_of("f0").unwrap(), 8 + 16 + 96);
    }

    #[test]
    fn recursion_and_unknown_targets_are_errors() {
        let p = program(&[(0, 8, &[10]), (10, 8, &[0]), (20, 8, &[99])]);
        assert!(p.depth_of("f0").unwrap_err().root_cause().to_string().contains("calls itself"));
        assert!(p.depth_of("f20").unwrap_err().root_cause().to_string().contains("no known function"));
    }

    #[test]
    fn calls_through_registers_need_a_rule_that_leads_somewhere() {
        let mut p = program(&[(0, 8, &[]), (10, 100, &[]), (20, 50, &[])]);
        p.functions.get_mut(&0).unwrap().indirect = true;
        assert!(p.depth_of("f0").unwrap_err().root_cause().to_string().contains("through a register"));
        p.rules = &[Rule { of: &["f0"], reach: &[Reach::Named("f1"), Reach::Named("f2")] }];
        assert_eq!(p.depth_of("f0").unwrap(), 108);
        p.ends = &["f10"];
        assert_eq!(p.depth_of("f0").unwrap(), 58);
        p.rules = &[Rule { of: &["f0"], reach: &[Reach::Calling("f", "f20")] }];
        assert!(p.depth_of("f0").is_err(), "no function calls f20");
        p.functions.get_mut(&10).unwrap().calls.insert(20);
        p.ends = &[];
        assert_eq!(p.depth_of("f0").unwrap(), 158);
        p.rules = &[Rule { of: &["f0"], reach: &[Reach::Named("gone")] }];
        assert!(p.depth_of("f0").unwrap_err().root_cause().to_string().contains("gone"));
    }

    #[test]
    fn addresses_among_constants_count_as_called_but_those_that_are_handed_on() {
        let mut p = program(&[(0, 8, &[]), (10, 100, &[]), (20, 50, &[])]);
        p.functions.get_mut(&0).unwrap().held = BTreeSet::from([10, 20, 99]);
        assert_eq!(p.depth_of("f0").unwrap(), 8, "constants of a function that makes no such calls are data");
        p.functions.get_mut(&0).unwrap().indirect = true;
        assert_eq!(p.depth_of("f0").unwrap(), 108, "what is no function's address is data");
        p.handed_on = &["f10"];
        assert_eq!(p.depth_of("f0").unwrap(), 58);
        // A call from memory beside them needs its rule, which comes on top.
        p.rules = &[Rule { of: &["f0"], reach: &[Reach::Named("f10")] }];
        assert_eq!(p.depth_of("f0").unwrap(), 108);
        p.rules = &[];
        p.handed_on = &["f"];
        assert!(p.depth_of("f0").unwrap_err().root_cause().to_string().contains("through a register"));
    }

    #[test]
    fn the_deepest_way_is_told_function_by_function() {
        let p = program(&[(0, 8, &[10, 20]), (10, 100, &[]), (20, 16, &[30]), (30, 96, &[])]);
        assert_eq!(p.way_by("f0", None).unwrap(), [("f0", 8), ("f20", 16), ("f30", 96)]);
        assert_eq!(p.largest(2), [("f10", 100), ("f30", 96)]);
    }

    #[test]
    fn a_function_is_found_by_its_name_or_by_a_part_that_no_other_has() {
        let mut p = program(&[(1, 8, &[]), (10, 100, &[]), (20, 50, &[])]);
        assert_eq!(p.depth_of("f1").unwrap(), 8, "the whole name comes first");
        assert_eq!(p.depth_of("20").unwrap(), 50);
        p.functions.get_mut(&20).unwrap().name = "f101".to_owned();
        assert!(p.depth_of("10").is_err(), "two have it");
        assert!(p.depth_of("f2").is_err());
    }

    #[test]
    fn a_function_is_read_from_its_code_and_not_from_its_literals() {
        // push {r7, lr}; bl 0x200; pop {r7, pc}; then a literal that would read as `sub sp, #508`.
        let halves = [0xb580_u16, 0xf000, 0xf87d, 0xbd80, 0xb0ff, 0xb0ff];
        let body: Vec<u8> = halves.iter().flat_map(|half| half.to_le_bytes()).collect();
        let function = Function::of("f".to_owned(), 0x100, &body, |address| address < 0x108);
        assert_eq!(function.frame, 8);
        assert_eq!(function.calls, BTreeSet::from([0x200]));
    }
}
