//! Cache of plant-model solutions, in memory and optionally in a file, so that an interrupted identification can resume.
//!
//! An identification is deterministic: a repeated run requests the same solutions and finds them in the file. Lines are
//! appended; an incomplete last line is ignored. The key holds all that a solution depends on: fingerprint of the machine,
//! correction, operating point and Kou, each number by its bits.

use std::collections::HashMap;
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::Path;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Mutex, PoisonError};

use kou_lumped::OperatingPoint;
use kou_records::InputError;

use crate::plant_model::{MachineCorrection, PlantError, PlantModel, SteadyResponse};

/// Solutions of a machine and its corrections.
struct CachedSolutions {
    known: HashMap<String, SteadyResponse>,
    file: Option<File>,
}

/// Solution cache of one identification.
pub struct SolutionCache {
    solutions: Mutex<CachedSolutions>,
    fingerprint: u32,
    computed: AtomicU32,
    tick: Box<dyn Fn() + Sync + Send>,
}

impl SolutionCache {
    /// Cache for the machine with this fingerprint, stored in the file at `path` if given; `tick` is called after each
    /// solution.
    ///
    /// # Errors
    /// A file that can be neither read nor created.
    pub fn new(
        fingerprint: u32,
        path: Option<&Path>,
        tick: impl Fn() + Sync + Send + 'static,
    ) -> Result<Self, InputError> {
        let mut known = HashMap::new();
        let file = match path {
            None => None,
            Some(path) => {
                let mut incomplete = false;
                let fail = |e: std::io::Error| InputError::new(format!("cannot be used: {e}")).at_file(path);
                if path.exists() {
                    let text = String::from_utf8_lossy(&std::fs::read(path).map_err(fail)?).into_owned();
                    incomplete = !text.is_empty() && !text.ends_with('\n');
                    known.extend(text.lines().filter_map(parse));
                }
                if let Some(folder) = path.parent() {
                    std::fs::create_dir_all(folder).map_err(fail)?;
                }
                let mut file = OpenOptions::new().create(true).append(true).open(path).map_err(fail)?;
                if incomplete {
                    file.write_all(b"\n").map_err(fail)?;
                }
                Some(file)
            }
        };
        let solutions = Mutex::new(CachedSolutions { known, file });
        Ok(Self { solutions, fingerprint, computed: AtomicU32::new(0), tick: Box::new(tick) })
    }

    /// Number of cache misses, which were computed.
    #[must_use]
    pub fn computed(&self) -> u32 {
        self.computed.load(Ordering::Relaxed)
    }

    /// Plant model that looks up its solutions in this cache.
    #[must_use]
    pub fn over<'a>(&'a self, model: &'a dyn PlantModel) -> CachedPlant<'a> {
        CachedPlant { cache: self, inner: Inner::Borrowed(model), correction: MachineCorrection::NONE }
    }

    fn key(&self, correction: MachineCorrection, at: &OperatingPoint, kou: f64) -> String {
        let numbers =
            [correction.displacement, correction.bulk, at.n_p_rpm, at.p_h_mpa, at.t_b_c, at.alpha, kou];
        let bits: Vec<String> = numbers.iter().map(|v| format!("{:x}", v.to_bits())).collect();
        format!("{:x}-{}", self.fingerprint, bits.join("-"))
    }
}

/// Parses `key ratio p_l end`, both numbers by their bits; `None` for an incomplete line.
fn parse(line: &str) -> Option<(String, SteadyResponse)> {
    let mut fields = line.split(' ');
    let key = fields.next()?.to_string();
    let mut number = || u64::from_str_radix(fields.next()?, 16).ok().map(f64::from_bits);
    let response = SteadyResponse { ratio: number()?, p_l_mpa: number()? };
    (fields.next() == Some("end") && response.ratio.is_finite()).then_some((key, response))
}

enum Inner<'a> {
    Borrowed(&'a dyn PlantModel),
    Owned(Box<dyn PlantModel + 'a>),
}

/// Plant model with a solution cache.
pub struct CachedPlant<'a> {
    cache: &'a SolutionCache,
    inner: Inner<'a>,
    correction: MachineCorrection,
}

impl CachedPlant<'_> {
    fn inner(&self) -> &dyn PlantModel {
        match &self.inner {
            Inner::Borrowed(model) => *model,
            Inner::Owned(model) => model.as_ref(),
        }
    }
}

impl PlantModel for CachedPlant<'_> {
    fn solve(&self, at: &OperatingPoint, kou: f64) -> Result<SteadyResponse, PlantError> {
        let key = self.cache.key(self.correction, at, kou);
        let lock = || self.cache.solutions.lock().unwrap_or_else(PoisonError::into_inner);
        let known = lock().known.get(&key).copied();
        let response = match known {
            Some(response) => response,
            None => {
                let response = self.inner().solve(at, kou)?;
                self.cache.computed.fetch_add(1, Ordering::Relaxed);
                let mut solutions = lock();
                if let Some(file) = &mut solutions.file {
                    let line = format!(
                        "{key} {:x} {:x} end\n",
                        response.ratio.to_bits(),
                        response.p_l_mpa.to_bits()
                    );
                    // A cache file that cannot be written only costs the next run time.
                    if file.write_all(line.as_bytes()).is_err() {
                        solutions.file = None;
                    }
                }
                solutions.known.insert(key, response);
                response
            }
        };
        (self.cache.tick)();
        Ok(response)
    }

    fn corrected(&self, correction: MachineCorrection) -> Result<Box<dyn PlantModel + '_>, InputError> {
        let inner = Inner::Owned(self.inner().corrected(correction)?);
        Ok(Box::new(CachedPlant { cache: self.cache, inner, correction }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ReducedPlant;
    use kou_lumped::machine::Machine;

    #[test]
    fn solutions_survive_an_interrupted_run_and_an_incomplete_line_is_ignored() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("partial");
        let machine =
            Machine::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../machines/reference.toml")).unwrap();
        let model = ReducedPlant::new(&machine).unwrap();
        let at = OperatingPoint { n_p_rpm: 1000.0, p_h_mpa: 30.0, p_l_mpa: None, t_b_c: 60.0, alpha: 1.0 };
        let correction = MachineCorrection { displacement: 1.01, bulk: 0.9 };
        let first = SolutionCache::new(7, Some(&path), || ()).unwrap();
        let a = first.over(&model).solve(&at, 0.05).unwrap();
        let b = first.over(&model).corrected(correction).unwrap().solve(&at, 0.05).unwrap();
        assert!(a != b && first.computed() == 2);
        // The run ends in the middle of a line.
        let mut text = std::fs::read(&path).unwrap();
        text.truncate(text.len() - 8);
        std::fs::write(&path, text).unwrap();
        let second = SolutionCache::new(7, Some(&path), || ()).unwrap();
        assert_eq!(second.over(&model).solve(&at, 0.05).unwrap(), a);
        assert_eq!(second.over(&model).corrected(correction).unwrap().solve(&at, 0.05).unwrap(), b);
        assert_eq!(second.computed(), 1, "the incomplete line only");
        // The solutions of another machine are not used.
        let other = SolutionCache::new(8, Some(&path), || ()).unwrap();
        other.over(&model).solve(&at, 0.05).unwrap();
        assert_eq!(other.computed(), 1);
    }
}
