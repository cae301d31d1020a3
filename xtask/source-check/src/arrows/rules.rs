//! Forbidden arrows: `xtask/arrows.toml`, and the check of those between modules.

use std::path::Path;

use anyhow::{Context, Result};
use serde::Deserialize;

use super::edges::Edge;
use crate::module_tree::{ModuleTree, SourceModule};

/// Path of the rules, below the workspace's root.
pub const FILE: &str = "xtask/arrows.toml";

/// All rules.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rules {
    /// Between packages of the workspace.
    #[serde(default, rename = "crate")]
    pub crates: Vec<CrateRule>,
    /// From packages of the workspace to packages of others.
    #[serde(default)]
    pub external: Vec<CrateRule>,
    /// Between modules.
    #[serde(default, rename = "module")]
    pub modules: Vec<ModuleRule>,
}

/// Packages that a package may not depend on, at first or second hand.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CrateRule {
    /// The package; `*` for every library but those of `to`.
    pub from: String,
    /// Packages that it may not need; `*` for all of the workspace. Of packages of others, a `*` ends a prefix.
    pub to: Vec<String>,
    /// With `from = "*"`: packages that may.
    #[serde(default)]
    pub except: Vec<String>,
    /// Reason.
    pub reason: String,
    /// Advice.
    pub instead: String,
}

/// Modules that a module may not name anything of.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModuleRule {
    /// Path of the module, crate first; what is below it counts as well.
    pub from: String,
    /// Paths of the modules that it may not name.
    pub to: Vec<String>,
    /// Reason.
    pub reason: String,
    /// Advice.
    pub instead: String,
}

impl Rules {
    /// Reads them.
    pub fn load(root: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(root.join(FILE)).with_context(|| format!("reading {FILE}"))?;
        Self::parse(&text).with_context(|| format!("reading {FILE}"))
    }

    /// Reads them from a text.
    pub fn parse(text: &str) -> Result<Self> {
        Ok(toml::from_str(text)?)
    }

    /// Forbidden arrows between modules, and rules about modules that do not exist.
    pub fn module_complaints(&self, tree: &ModuleTree, edges: &[Edge]) -> Vec<String> {
        let mut complaints = Vec::new();
        for rule in &self.modules {
            for gone in [&rule.from].into_iter().chain(&rule.to).filter(|path| !tree.has(path)) {
                complaints.push(format!(
                    "{FILE} has a rule for the module `{gone}`, which does not exist: it protects nothing. Name the module by \
                     its present path"
                ));
            }
            let mut seen: Vec<(&Path, usize, &str)> = Vec::new();
            for edge in edges {
                let from = tree.module(edge.from);
                if !is_below(from, &rule.from) {
                    continue;
                }
                let mut reached = edge.through.iter().chain([&edge.to]).map(|id| tree.module(*id));
                let Some(to) = reached.find_map(|module| rule.to.iter().find(|to| is_below(module, to)))
                else {
                    continue;
                };
                let place = (from.file.as_path(), edge.line, edge.path.as_str());
                if seen.contains(&place) {
                    continue;
                }
                seen.push(place);
                complaints.push(format!(
                    "{}:{}: `{}` imports `{}`, but `{}` may not name anything of `{to}`: {}. Instead: {}",
                    from.file.display(),
                    edge.line,
                    from.path,
                    edge.path,
                    rule.from,
                    rule.reason,
                    rule.instead
                ));
            }
        }
        complaints
    }
}

fn is_below(module: &SourceModule, path: &str) -> bool {
    module.path.strip_prefix(path).is_some_and(|rest| rest.is_empty() || rest.starts_with("::"))
}
