//! Exceptions and terms: `xtask/names.toml`.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context, Result};
use serde::Deserialize;

/// Path of the data below the workspace's root.
pub const FILE: &str = "xtask/names.toml";

/// Exceptions and terms.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NameRules {
    /// Type names that may stand more than once, and why.
    #[serde(default)]
    pub repeated: BTreeMap<String, String>,
    /// Identifiers, compared to the letter, and the standard term for each.
    #[serde(default)]
    pub identifiers: BTreeMap<String, String>,
    /// Words in identifiers (`error` in `ratio_error` and `RatioError`), comments and documents, and the standard terms.
    #[serde(default)]
    pub words: BTreeMap<String, String>,
    /// Uses of such a word that stay.
    #[serde(default, rename = "except")]
    pub exceptions: Vec<TermException>,
}

/// A word that stays in the files below a path.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TermException {
    /// The identifier or word.
    pub word: String,
    /// Start of the files' paths.
    pub path: String,
    /// Reason.
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
