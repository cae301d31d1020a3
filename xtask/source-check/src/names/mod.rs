//! Names: no type name twice in the workspace, and standard terms instead of words of our own. The data: `xtask/names.toml`.

mod rules;
mod terms;
#[cfg(test)]
mod tests;
mod types;

use anyhow::Result;

use crate::files;
use crate::packages::Metadata;
use rules::NameRules;

/// Checks the workspace; returns complaints and a summary.
pub fn check_workspace() -> Result<(Vec<String>, String)> {
    let root = Metadata::load()?.workspace_root;
    let (rules, repository) = (NameRules::load(&root)?, files::read(&root)?);
    let (mut complaints, types) = types::repeated(&repository, &rules)?;
    complaints.extend(terms::found(&repository, &rules)?);
    Ok((
        complaints,
        format!("names: {types} type names, {} terms", rules.identifiers.len() + rules.words.len()),
    ))
}
