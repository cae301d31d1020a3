//! Links between documents, and paths of the repository in documents and comments.

use super::markdown::Document;
use crate::files::Repository;

/// Endings by which a path without a known first folder is recognised.
const SOURCE_ENDINGS: [&str; 2] = [".rs", ".ld"];

/// Relative links that lead nowhere, and anchors that are no heading.
pub fn broken_links(document: &Document, all: &[Document], repository: &Repository) -> Vec<String> {
    let mut complaints = Vec::new();
    for (line, target) in &document.links {
        if target.contains("://") || target.starts_with("mailto:") {
            continue;
        }
        let (file, anchor) = target.split_once('#').unwrap_or((target, ""));
        let path = if file.is_empty() { document.path.clone() } else { join(&document.path, file) };
        if !repository.has(&path) {
            complaints.push(format!(
                "{}:{line}: the link `{target}` leads to `{path}`, which does not exist",
                document.path
            ));
            continue;
        }
        let known =
            all.iter().find(|other| other.path == path).is_none_or(|other| other.anchors.contains(anchor));
        if !anchor.is_empty() && !known {
            complaints.push(format!("{}:{line}: `{path}` has no heading `#{anchor}`", document.path));
        }
    }
    complaints
}

/// A link's file, from the folder of the document that has it.
fn join(document: &str, file: &str) -> String {
    let mut parts: Vec<&str> = document.split('/').collect();
    parts.pop();
    for part in file.split('/') {
        match part {
            "" | "." => {}
            ".." => {
                parts.pop();
            }
            name => parts.push(name),
        }
    }
    parts.join("/")
}

/// Paths in a document's code spans that do not exist.
pub fn missing_in_document(document: &Document, repository: &Repository) -> Vec<String> {
    let missing = document.code.iter().filter(|(_, code)| is_missing(code, repository));
    missing.map(|(line, code)| complaint(&document.path, *line, code)).collect()
}

/// The same for comments of the sources.
pub fn missing_in_comments(repository: &Repository) -> Vec<String> {
    let mut complaints = Vec::new();
    for (path, text) in repository.with_extension("rs") {
        for (at, line) in text.lines().enumerate() {
            let Some(comment) = line.trim_start().strip_prefix("//") else { continue };
            for code in comment.split('`').skip(1).step_by(2) {
                // Of paths without a known first folder, Rust's own stand in comments as well.
                if has_known_folder(code, repository) && is_missing(code, repository) {
                    complaints.push(complaint(path, at + 1, code));
                }
            }
        }
    }
    complaints
}

fn complaint(path: &str, line: usize, code: &str) -> String {
    format!("{path}:{line}: `{code}` does not exist in the repository")
}

fn has_known_folder(code: &str, repository: &Repository) -> bool {
    code.split_once('/').is_some_and(|(folder, _)| {
        repository.paths().any(|path| path.split_once('/').is_some_and(|(first, _)| first == folder))
    })
}

/// True for what is a path of the repository by its form and does not exist.
fn is_missing(code: &str, repository: &Repository) -> bool {
    let is_path = |c: char| c.is_alphanumeric() || "/._-*".contains(c);
    if !code.chars().all(is_path) || code.contains("...") {
        return false;
    }
    if has_known_folder(code, repository) {
        return !repository.has(code) && !repository.has_below(code);
    }
    SOURCE_ENDINGS.iter().any(|ending| code.ends_with(ending)) && !repository.has_below(code)
}
