//! Modules of all crates and the files that they come from.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

use super::collect::{self, Import, Mention};

/// Index of a module in its tree.
pub type ModuleId = usize;

/// Modules of all crates of a workspace.
#[derive(Debug, Default)]
pub struct ModuleTree {
    /// All modules; a crate's root is one of them.
    pub modules: Vec<SourceModule>,
    /// Roots of the libraries by the name that paths use.
    pub libraries: BTreeMap<String, ModuleId>,
    /// Exported macros of all crates by name, and the module that defines them.
    pub macros: BTreeMap<String, ModuleId>,
}

/// A module: a file, or a part of one.
#[derive(Debug)]
pub struct SourceModule {
    /// Crate and modules, as in a path: `kou_estimator::health::cusum`.
    pub path: String,
    /// Its file.
    pub file: PathBuf,
    /// Module above it; none for a crate's root.
    pub parent: Option<ModuleId>,
    /// Modules that it declares.
    pub children: BTreeMap<String, ModuleId>,
    /// Types, functions, constants and macros defined here.
    pub definitions: BTreeSet<String>,
    /// `use` declarations, one for each name.
    pub imports: Vec<Import>,
    /// Paths in the code, without those of `use` declarations.
    pub mentions: Vec<Mention>,
}

/// Origin of the text of a source file.
pub trait Sources {
    /// The file's text; none when there is no such file.
    fn text(&self, path: &Path) -> Option<String>;
}

/// Source files below a folder.
#[derive(Debug)]
pub struct Disk(pub PathBuf);

impl Sources for Disk {
    fn text(&self, path: &Path) -> Option<String> {
        std::fs::read_to_string(self.0.join(path)).ok()
    }
}

impl ModuleTree {
    /// Adds a crate: its root file and every file that it declares.
    pub fn add_crate(
        &mut self,
        name: &str,
        is_library: bool,
        root: &Path,
        sources: &dyn Sources,
    ) -> Result<()> {
        // A root's modules lie next to it, as those of a `mod.rs`.
        let id = self.add_file(name.to_owned(), None, root.to_owned(), true, sources)?;
        if is_library {
            self.libraries.insert(name.to_owned(), id);
        }
        Ok(())
    }

    fn add_file(
        &mut self,
        path: String,
        parent: Option<ModuleId>,
        file: PathBuf,
        owns_folder: bool,
        sources: &dyn Sources,
    ) -> Result<ModuleId> {
        let text = sources.text(&file).with_context(|| format!("reading {}", file.display()))?;
        let syntax = syn::parse_file(&text)
            .map_err(|error| anyhow::anyhow!("{}:{}: {error}", file.display(), error.span().start().line))?;
        let folder = file.parent().unwrap_or(Path::new(""));
        let folder =
            if owns_folder { folder.to_owned() } else { folder.join(file.file_stem().unwrap_or_default()) };
        self.add_module(path, parent, &file, &folder, &syntax.items, sources)
    }

    fn add_module(
        &mut self,
        path: String,
        parent: Option<ModuleId>,
        file: &Path,
        folder: &Path,
        items: &[syn::Item],
        sources: &dyn Sources,
    ) -> Result<ModuleId> {
        let found = collect::collect(items);
        let id = self.modules.len();
        for name in &found.exported_macros {
            self.macros.insert(name.clone(), id);
        }
        self.modules.push(SourceModule {
            path: path.clone(),
            file: file.to_owned(),
            parent,
            children: BTreeMap::new(),
            definitions: found.definitions,
            imports: found.imports,
            mentions: found.mentions,
        });
        for child in found.children {
            let name = child.ident.to_string();
            let child_path = format!("{path}::{name}");
            let child_folder = folder.join(&name);
            let child_id = match &child.content {
                Some((_, items)) => {
                    self.add_module(child_path, Some(id), file, &child_folder, items, sources)?
                }
                None => {
                    let flat = collect::path_attribute(child)
                        .map_or_else(|| folder.join(format!("{name}.rs")), |path| folder.join(path));
                    let nested = child_folder.join("mod.rs");
                    let (file, owns_folder) = if sources.text(&flat).is_some() {
                        (flat, false)
                    } else if sources.text(&nested).is_some() {
                        (nested, true)
                    } else {
                        bail!("{} declares `mod {name}`, which has no file", file.display())
                    };
                    self.add_file(child_path, Some(id), file, owns_folder, sources)?
                }
            };
            if let Some(module) = self.modules.get_mut(id) {
                module.children.insert(name, child_id);
            }
        }
        Ok(id)
    }

    /// The module of an index.
    pub fn module(&self, id: ModuleId) -> &SourceModule {
        &self.modules[id]
    }

    /// A module's file, as messages show it.
    pub fn file(&self, id: ModuleId) -> &str {
        self.module(id).file.to_str().unwrap_or("?")
    }

    /// The modules from the crate's root down to a module.
    pub fn ancestry(&self, id: ModuleId) -> Vec<ModuleId> {
        let mut modules: Vec<ModuleId> =
            std::iter::successors(Some(id), |id| self.module(*id).parent).collect();
        modules.reverse();
        modules
    }

    /// True when a module of this path exists.
    pub fn has(&self, path: &str) -> bool {
        self.modules.iter().any(|module| module.path == path)
    }
}

impl SourceModule {
    /// Names with which paths of this module's code begin.
    pub fn mentioned(&self) -> BTreeSet<&str> {
        self.mentions.iter().filter_map(|mention| mention.path.first()).map(String::as_str).collect()
    }
}
