//! Files of the repository.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context, Result};
use walkdir::WalkDir;

/// Folders of build results and of other tools.
const SKIPPED: [&str; 4] = ["target", "out", ".git", "node_modules"];
/// Files whose text is read.
const TEXTS: [&str; 3] = ["md", "rs", "toml"];

/// Paths of all files, relative to the root and with `/`, and the text of those that are checked.
#[derive(Debug, Default)]
pub struct Repository {
    files: BTreeMap<String, Option<String>>,
}

/// Reads the files below a folder.
pub fn read(root: &Path) -> Result<Repository> {
    let mut repository = Repository::default();
    let walk = WalkDir::new(root).into_iter().filter_entry(|entry| {
        entry.depth() == 0 || !SKIPPED.iter().any(|skipped| entry.file_name() == *skipped)
    });
    for entry in walk {
        let entry = entry?;
        if !entry.file_type().is_file() {
            continue;
        }
        let path = entry.path().strip_prefix(root)?.to_string_lossy().replace('\\', "/");
        let is_text =
            TEXTS.iter().any(|extension| path.rsplit_once('.').is_some_and(|(_, end)| end == *extension));
        let read = || std::fs::read_to_string(entry.path()).with_context(|| format!("reading {path}"));
        let text = is_text.then(read).transpose()?;
        repository.files.insert(path, text);
    }
    Ok(repository)
}

impl Repository {
    /// All paths.
    pub fn paths(&self) -> impl Iterator<Item = &str> {
        self.files.keys().map(String::as_str)
    }

    /// Path and text of the files with an extension.
    pub fn with_extension(&self, extension: &str) -> impl Iterator<Item = (&str, &str)> {
        let end = format!(".{extension}");
        self.files.iter().filter_map(move |(path, text)| {
            Some((path.as_str(), text.as_deref()?)).filter(|_| path.ends_with(&end))
        })
    }

    /// True for a file, or for a folder that holds one. A `*` stands for any name.
    pub fn has(&self, path: &str) -> bool {
        let wanted: Vec<&str> = path.split('/').filter(|part| !part.is_empty()).collect();
        self.paths().any(|file| {
            let mut parts = file.split('/');
            wanted.iter().all(|wanted| parts.next().is_some_and(|part| matches(wanted, part)))
        })
    }

    /// True when some file, or a folder that holds one, ends with these path components.
    pub fn has_below(&self, path: &str) -> bool {
        let wanted: Vec<&str> = path.split('/').filter(|part| !part.is_empty()).collect();
        self.paths().any(|file| {
            let parts: Vec<&str> = file.split('/').collect();
            parts
                .windows(wanted.len())
                .any(|window| wanted.iter().zip(window).all(|(wanted, part)| matches(wanted, part)))
        })
    }

    /// Text of a file.
    pub fn text(&self, path: &str) -> Option<&str> {
        self.files.get(path)?.as_deref()
    }
}

#[cfg(test)]
impl FromIterator<(&'static str, &'static str)> for Repository {
    fn from_iter<T: IntoIterator<Item = (&'static str, &'static str)>>(files: T) -> Self {
        let owned = |(path, text): (&str, &str)| (path.to_owned(), Some(text.to_owned()));
        Self { files: files.into_iter().map(owned).collect() }
    }
}

fn matches(wanted: &str, name: &str) -> bool {
    match wanted.split_once('*') {
        Some((start, end)) => {
            name.len() >= start.len() + end.len() && name.starts_with(start) && name.ends_with(end)
        }
        None => wanted == name,
    }
}
