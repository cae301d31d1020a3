//! Arrows between crates and modules that may never be, and circles of imports.
//!
//! Forbidden arrows are data: `xtask/arrows.toml`. Circles are looked for among the files of every library and binary: a file
//! points to the file that defines what it names. A `mod` declaration is no arrow, and neither is a re-export, so that a facade
//! in a `mod.rs` closes no circle.

mod circles;
mod crates;
mod edges;
mod rules;

use anyhow::{Context, Result};

use crate::module_tree::{Disk, ModuleTree};
use crate::packages::Metadata;
use rules::Rules;

/// Checks the workspace; returns complaints and a summary.
pub fn check_workspace() -> Result<(Vec<String>, String)> {
    let metadata = Metadata::load()?;
    let rules = Rules::load(&metadata.workspace_root)?;
    let mut tree = ModuleTree::default();
    for package in &metadata.packages {
        for target in package.targets.iter().filter(|target| target.is_product()) {
            let (name, root) = (target.crate_name(), metadata.relative(&target.src_path));
            tree.add_crate(&name, target.is_library(), root, &Disk(metadata.workspace_root.clone()))
                .with_context(|| format!("reading {}", root.display()))?;
        }
    }
    let (edges, crates) = (edges::edges(&tree), metadata.packages.len());
    let mut complaints = crates::complaints(&metadata, &rules);
    complaints.extend(rules.module_complaints(&tree, &edges));
    complaints.extend(circles::complaints(&tree, &edges));
    let summary =
        format!("arrows: {crates} packages, {} modules, {} imports", tree.modules.len(), edges.len());
    Ok((complaints, summary))
}

#[cfg(test)]
mod tests;
