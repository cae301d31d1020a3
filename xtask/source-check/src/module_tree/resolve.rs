//! From a path in a module to the module that defines what it names.

use super::collect::Import;
use super::tree::{ModuleId, ModuleTree};

/// Target of a path.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Resolution {
    /// The module that defines it, or the module itself.
    pub module: ModuleId,
    /// False when the path names a module and nothing in it.
    pub is_item: bool,
    /// Modules that the path, or a re-export on its way, goes through.
    pub through: Vec<ModuleId>,
}

/// Chains of re-exports longer than this are circles of globs.
const MAX_DEPTH: usize = 24;

impl ModuleTree {
    /// Target of a path in a module's code names; none for what other crates, the prelude or the block define.
    pub fn resolve(&self, from: ModuleId, path: &[String]) -> Option<Resolution> {
        self.walk(from, path, 0)
    }

    fn root_of(&self, mut module: ModuleId) -> ModuleId {
        while let Some(parent) = self.module(module).parent {
            module = parent;
        }
        module
    }

    fn walk(&self, from: ModuleId, path: &[String], depth: usize) -> Option<Resolution> {
        if depth > MAX_DEPTH {
            return None;
        }
        let mut at = from;
        let mut through = Vec::new();
        let mut rest = path;
        let mut is_first = true;
        while let Some((segment, tail)) = rest.split_first() {
            match segment.as_str() {
                "crate" => at = self.root_of(at),
                "self" => {}
                "super" => at = self.module(at).parent?,
                "::" => {
                    let (name, after) = tail.split_first()?;
                    at = *self.libraries.get(name)?;
                    rest = after;
                    is_first = false;
                    continue;
                }
                name => {
                    let found = self.lookup(at, name, !tail.is_empty(), depth + 1);
                    let outside = || {
                        let module = *self.libraries.get(name).filter(|_| is_first)?;
                        Some(Resolution { module, is_item: false, through: Vec::new() })
                    };
                    let found = found.or_else(outside)?;
                    through.extend(found.through);
                    if found.is_item {
                        return Some(Resolution { module: found.module, is_item: true, through });
                    }
                    at = found.module;
                    through.push(at);
                }
            }
            rest = tail;
            is_first = false;
        }
        Some(Resolution { module: at, is_item: false, through })
    }

    /// A name in a module's scope. `goes_on` when more segments follow, so that a module is preferred.
    fn lookup(&self, at: ModuleId, name: &str, goes_on: bool, depth: usize) -> Option<Resolution> {
        if depth > MAX_DEPTH {
            return None;
        }
        let module = self.module(at);
        let child = || {
            let module = *module.children.get(name)?;
            Some(Resolution { module, is_item: false, through: Vec::new() })
        };
        let defined = || {
            let here = module.definitions.contains(name);
            here.then(|| Resolution { module: at, is_item: true, through: Vec::new() })
        };
        let imported = |item: bool| {
            let named =
                module.imports.iter().filter(|import| import.name == name && !points_to_itself(import));
            named
                .filter_map(|import| self.walk(at, &import.path, depth + 1))
                .find(|found| found.is_item == item)
        };
        let globbed = || {
            module.imports.iter().filter(|import| import.name == "*").find_map(|import| {
                let source = self.walk(at, &import.path, depth + 1).filter(|source| !source.is_item)?;
                let found =
                    (source.module != at).then(|| self.lookup(source.module, name, goes_on, depth + 1))??;
                let through = source.through.into_iter().chain(found.through.clone()).collect();
                Some(Resolution { through, ..found })
            })
        };
        let exported = || {
            let module = *self.macros.get(name)?;
            Some(Resolution { module, is_item: true, through: Vec::new() })
        };
        let found = if goes_on {
            child().or_else(|| imported(false)).or_else(defined).or_else(|| imported(true))
        } else {
            defined().or_else(|| imported(true)).or_else(child).or_else(|| imported(false))
        };
        found.or_else(globbed).or_else(|| if depth > 1 { None } else { exported() })
    }
}

/// `pub(crate) use name;` makes a macro visible by the name that it has already.
fn points_to_itself(import: &Import) -> bool {
    matches!(import.path.as_slice(), [only] if *only == import.name)
        || matches!(import.path.as_slice(), [here, only] if here == "self" && *only == import.name)
}
