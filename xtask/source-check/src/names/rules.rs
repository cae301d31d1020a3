//! Exceptions and terms: `xtask/names.toml`.

use std::path::Path;

use anyhow::{Context, Result};
use serde::Deserialize;

/// Path of the data below the workspace's root.
pub const FILE: &str = "xtask/names.toml";

/// Exceptions and terms.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NameRules {
    /// Type names that may stand more than once.
    #[serde(default)]
    pub repeated: Vec<RepeatedName>,
    /// Words and the standard terms for them.
    #[serde(default, rename = "term")]
    pub terms: Vec<Term>,
    /// Uses of such a word that stay.
    #[serde(default, rename = "except")]
    pub exceptions: Vec<TermException>,
}

/// A type name that may stand more than once.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RepeatedName {
    /// The name.
    pub name: String,
    /// Why it stays.
    #[serde(rename = "reason")]
    _reason: String,
}

/// Words that mean one thing and the standard term for it.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Term {
    /// Identifiers, to the letter.
    #[serde(default)]
    pub identifiers: Vec<String>,
    /// Words in identifiers (`deficit` in `ratio_deficit` and `RatioDeficit`), in comments and in documents.
    #[serde(default)]
    pub words: Vec<String>,
    /// The standard term.
    pub standard: String,
}

/// A word that stays in the files below a path.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TermException {
    /// The identifier or word.
    pub word: String,
    /// Start of the files' paths.
    pub path: String,
    /// Why it stays.
    #[serde(rename = "reason")]
    _reason: String,
}

impl NameRules {
    /// Reads the data.
    pub fn load(root: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(root.join(FILE)).with_context(|| format!("reading {FILE}"))?;
        toml::from_str(&text).with_context(|| format!("reading {FILE}"))
    }
}
