//! A model that remembers: every answer is kept, on request in a file, and is not computed twice.
//!
//! An identification asks the same questions in the same order every time, so a run that was interrupted finds its answers
//! in the file and goes on where it ended. Lines are appended whole; a torn last line is passed over. A key is all that
//! the answer depends on: fingerprint of the machine, change, operating point and Kou, each number by its bits.

use std::collections::HashMap;
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::Path;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Mutex, PoisonError};

use super::ratio_model::{Change, OperatingPoint, RatioModel, Solved};
use kou_lumped::SimError;
use kou_records::InputError;

/// What is shared between the models of a machine and of its changes.
struct Store {
    known: HashMap<String, Solved>,
    file: Option<File>,
}

/// Answers of one identification.
pub struct Memory {
    store: Mutex<Store>,
    fingerprint: u32,
    computed: AtomicU32,
    tick: Box<dyn Fn() + Sync + Send>,
}

impl Memory {
    /// Memory for a machine with this fingerprint, kept in a file where one is named; `tick` is called after each answer.
    ///
    /// # Errors
    /// When the file can be neither read nor made.
    pub fn new(
        fingerprint: u32,
        path: Option<&Path>,
        tick: impl Fn() + Sync + Send + 'static,
    ) -> Result<Self, InputError> {
        let mut known = HashMap::new();
        let file = match path {
            None => None,
            Some(path) => {
                let mut torn = false;
                let fail = |e: std::io::Error| InputError::new(format!("cannot be used: {e}")).at_file(path);
                if path.exists() {
                    let text = String::from_utf8_lossy(&std::fs::read(path).map_err(fail)?).into_owned();
                    torn = !text.is_empty() && !text.ends_with('\n');
                    known.extend(text.lines().filter_map(parse));
                }
                if let Some(folder) = path.parent() {
                    std::fs::create_dir_all(folder).map_err(fail)?;
                }
                let mut file = OpenOptions::new().create(true).append(true).open(path).map_err(fail)?;
                if torn {
                    file.write_all(b"\n").map_err(fail)?;
                }
                Some(file)
            }
        };
        let store = Mutex::new(Store { known, file });
        Ok(Self { store, fingerprint, computed: AtomicU32::new(0), tick: Box::new(tick) })
    }

    /// Answers that were computed and not found.
    #[must_use]
    pub fn computed(&self) -> u32 {
        self.computed.load(Ordering::Relaxed)
    }

    /// A model that uses this memory.
    #[must_use]
    pub fn over<'a>(&'a self, model: &'a dyn RatioModel) -> Remembering<'a> {
        Remembering { memory: self, inner: Inner::Borrowed(model), change: Change::NONE }
    }

    fn key(&self, change: Change, at: &OperatingPoint, kou: f64) -> String {
        let numbers = [change.displacement, change.bulk, at.n_p_rpm, at.p_h_mpa, at.t_b_c, at.alpha, kou];
        let bits: Vec<String> = numbers.iter().map(|v| format!("{:x}", v.to_bits())).collect();
        format!("{:x}-{}", self.fingerprint, bits.join("-"))
    }
}

/// `key ratio p_l end`, both numbers by their bits; nothing for a torn line.
fn parse(line: &str) -> Option<(String, Solved)> {
    let mut words = line.split(' ');
    let key = words.next()?.to_string();
    let mut number = || u64::from_str_radix(words.next()?, 16).ok().map(f64::from_bits);
    let solved = Solved { ratio: number()?, p_l_mpa: number()? };
    (words.next() == Some("end") && solved.ratio.is_finite()).then_some((key, solved))
}

enum Inner<'a> {
    Borrowed(&'a dyn RatioModel),
    Owned(Box<dyn RatioModel + 'a>),
}

/// A model with a memory.
pub struct Remembering<'a> {
    memory: &'a Memory,
    inner: Inner<'a>,
    change: Change,
}

impl Remembering<'_> {
    fn inner(&self) -> &dyn RatioModel {
        match &self.inner {
            Inner::Borrowed(model) => *model,
            Inner::Owned(model) => model.as_ref(),
        }
    }
}

impl RatioModel for Remembering<'_> {
    fn solve(&self, at: &OperatingPoint, kou: f64) -> Result<Solved, SimError> {
        let key = self.memory.key(self.change, at, kou);
        let lock = || self.memory.store.lock().unwrap_or_else(PoisonError::into_inner);
        let known = lock().known.get(&key).copied();
        let solved = match known {
            Some(solved) => solved,
            None => {
                let solved = self.inner().solve(at, kou)?;
                self.memory.computed.fetch_add(1, Ordering::Relaxed);
                let mut store = lock();
                if let Some(file) = &mut store.file {
                    let line =
                        format!("{key} {:x} {:x} end\n", solved.ratio.to_bits(), solved.p_l_mpa.to_bits());
                    // A memory that cannot be written costs time on the next run, nothing else.
                    if file.write_all(line.as_bytes()).is_err() {
                        store.file = None;
                    }
                }
                store.known.insert(key, solved);
                solved
            }
        };
        (self.memory.tick)();
        Ok(solved)
    }

    fn changed(&self, change: Change) -> Result<Box<dyn RatioModel + '_>, InputError> {
        let inner = Inner::Owned(self.inner().changed(change)?);
        Ok(Box::new(Remembering { memory: self.memory, inner, change }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ratio_model::ReducedRatio;
    use kou_lumped::machine::Machine;

    #[test]
    fn interrupted_run_finds_its_answers_again_and_passes_over_a_torn_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("partial");
        let machine =
            Machine::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../machines/reference.toml")).unwrap();
        let model = ReducedRatio::new(&machine).unwrap();
        let at = OperatingPoint { n_p_rpm: 1000.0, p_h_mpa: 30.0, p_l_mpa: None, t_b_c: 60.0, alpha: 1.0 };
        let change = Change { displacement: 1.01, bulk: 0.9 };
        let first = Memory::new(7, Some(&path), || ()).unwrap();
        let a = first.over(&model).solve(&at, 0.05).unwrap();
        let b = first.over(&model).changed(change).unwrap().solve(&at, 0.05).unwrap();
        assert!(a != b && first.computed() == 2);
        // The run ends in the middle of a line.
        let mut text = std::fs::read(&path).unwrap();
        text.truncate(text.len() - 8);
        std::fs::write(&path, text).unwrap();
        let second = Memory::new(7, Some(&path), || ()).unwrap();
        assert_eq!(second.over(&model).solve(&at, 0.05).unwrap(), a);
        assert_eq!(second.over(&model).changed(change).unwrap().solve(&at, 0.05).unwrap(), b);
        assert_eq!(second.computed(), 1, "the torn line only");
        // Another machine's answers are not ours.
        let other = Memory::new(8, Some(&path), || ()).unwrap();
        other.over(&model).solve(&at, 0.05).unwrap();
        assert_eq!(other.computed(), 1);
    }
}
