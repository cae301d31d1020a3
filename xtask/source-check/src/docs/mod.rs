//! Facts of the documents that the sources can prove: links, paths, commands, names, line lengths.

mod facts;
mod markdown;
mod paths;
#[cfg(test)]
mod tests;

use anyhow::Result;

use crate::files::{self, Repository};
use crate::packages::Metadata;
use markdown::Document;

/// Longest line of prose, in characters.
const MAX_COLUMNS: usize = 120;

/// Checks all documents; returns complaints and a summary.
pub fn check_workspace() -> Result<(Vec<String>, String)> {
    let metadata = Metadata::load()?;
    let repository = files::read(&metadata.workspace_root)?;
    let documents: Vec<Document> =
        repository.with_extension("md").map(|(path, text)| Document::parse(path, text)).collect();
    let mut complaints = complaints(&repository, &documents);
    complaints.extend(facts::missing_tests(&metadata.packages, &documents));
    let summary = format!("docs: {} documents, {} files", documents.len(), repository.paths().count());
    Ok((complaints, summary))
}

/// Complaints that follow from the documents and the other files alone.
fn complaints(repository: &Repository, documents: &[Document]) -> Vec<String> {
    let mut complaints = Vec::new();
    for document in documents {
        complaints.extend(document.long_lines(MAX_COLUMNS));
        complaints.extend(paths::broken_links(document, documents, repository));
        complaints.extend(paths::missing_in_document(document, repository));
    }
    complaints.extend(paths::missing_in_comments(repository));
    complaints.extend(facts::undocumented_commands(repository, documents));
    complaints.extend(facts::undocumented_names(repository, documents));
    complaints.extend(facts::wrong_counts(repository, documents));
    complaints
}
