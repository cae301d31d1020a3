//! Names: no type name twice in the workspace, and standard terms instead of words of our own. The data: `xtask/names.toml`.

mod terms;
#[cfg(test)]
mod tests;
mod types;

use std::path::Path;

use anyhow::{Context, Result};
use serde::Deserialize;

use crate::files;
use crate::packages::Metadata;

/// Where the data stands, below the workspace's root.
const FILE: &str = "xtask/names.toml";

/// Exceptions and terms.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct NameRules {
    /// Type names that may stand more than once.
    #[serde(default)]
    repeated: Vec<RepeatedName>,
    /// Words and the standard terms for them.
    #[serde(default, rename = "term")]
    terms: Vec<Term>,
    /// Uses of such a word that stay.
    #[serde(default, rename = "except")]
    exceptions: Vec<TermException>,
}

/// A type name that may stand more than once.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RepeatedName {
    name: String,
    /// Why.
    #[serde(rename = "reason")]
    _reason: String,
}

/// Words that mean one thing and the standard term for it.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Term {
    /// Identifiers, to the letter.
    #[serde(default)]
    identifiers: Vec<String>,
    /// Words in identifiers (`deficit` in `ratio_deficit` and `RatioDeficit`), in comments and in documents.
    #[serde(default)]
    words: Vec<String>,
    /// The standard term.
    standard: String,
}

/// A word that stays in the files below a path.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct TermException {
    word: String,
    path: String,
    /// Why.
    #[serde(rename = "reason")]
    _reason: String,
}

impl NameRules {
    fn load(root: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(root.join(FILE)).with_context(|| format!("reading {FILE}"))?;
        toml::from_str(&text).with_context(|| format!("reading {FILE}"))
    }
}

/// Checks the workspace; returns complaints and a summary.
pub fn check_workspace() -> Result<(Vec<String>, String)> {
    let root = Metadata::load()?.workspace_root;
    let (rules, repository) = (NameRules::load(&root)?, files::read(&root)?);
    let (mut complaints, types) = types::repeated(&repository, &rules)?;
    complaints.extend(terms::found(&repository, &rules)?);
    Ok((complaints, format!("names: {types} type names, {} terms", rules.terms.len())))
}
