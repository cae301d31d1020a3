//! Type names that stand more than once in the workspace.

use std::collections::BTreeMap;

use anyhow::Result;
use syn::visit::{self, Visit};

use super::rules::{FILE, NameRules};
use crate::files::Repository;

/// Complaints about every repeated name and every exception without use, and the number of names.
pub fn repeated(repository: &Repository, rules: &NameRules) -> Result<(Vec<String>, usize)> {
    let mut places: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for (path, text) in repository.with_extension("rs") {
        let file = syn::parse_file(text)
            .map_err(|error| anyhow::anyhow!("{path}:{}: {error}", error.span().start().line))?;
        let mut types = DefinedTypes::default();
        types.visit_file(&file);
        for (name, line) in types.found {
            places.entry(name).or_default().push(format!("{path}:{line}"));
        }
    }
    let is_allowed = |name: &str| rules.repeated.contains_key(name);
    let mut complaints: Vec<String> = places
        .iter()
        .filter(|(name, places)| places.len() > 1 && !is_allowed(name))
        .map(|(name, places)| {
            format!(
                "type name `{name}` stands {} times: {}. One name, one meaning: give each a name that says which one it is, or \
                 share one type",
                places.len(),
                places.join(", ")
            )
        })
        .collect();
    for allowed in rules.repeated.keys() {
        if places.get(allowed).is_none_or(|places| places.len() < 2) {
            complaints
                .push(format!("{FILE} allows `{allowed}` to be repeated, which it is not: remove it there"));
        }
    }
    Ok((complaints, places.len()))
}

/// Types of a file, in every module and function; associated types are none.
#[derive(Default)]
struct DefinedTypes {
    found: Vec<(String, usize)>,
}

impl DefinedTypes {
    fn push(&mut self, name: &syn::Ident) {
        self.found.push((name.to_string(), name.span().start().line));
    }
}

impl<'ast> Visit<'ast> for DefinedTypes {
    fn visit_item(&mut self, item: &'ast syn::Item) {
        match item {
            syn::Item::Enum(item) => self.push(&item.ident),
            syn::Item::Struct(item) => self.push(&item.ident),
            syn::Item::Trait(item) => self.push(&item.ident),
            syn::Item::Type(item) => self.push(&item.ident),
            syn::Item::Union(item) => self.push(&item.ident),
            _ => {}
        }
        visit::visit_item(self, item);
    }
}
