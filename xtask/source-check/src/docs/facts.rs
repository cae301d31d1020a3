//! Names and numbers that documents must share with the sources.

use std::collections::BTreeSet;

use syn::visit::{self, Visit};

use super::markdown::Document;
use crate::files::Repository;
use crate::packages::PackageMetadata;

/// File that lists xtask's commands, one a line, in its text for `help`.
const XTASK: &str = "xtask/src/main.rs";
/// Folder of the scenarios that are shipped.
const SCENARIOS: &str = "host-sim/scenarios/";

/// Commands that no document calls.
pub fn undocumented_commands(repository: &Repository, documents: &[Document]) -> Vec<String> {
    let mut calls: BTreeSet<String> = BTreeSet::new();
    for (_, text) in repository.with_extension("rs").filter(|(path, _)| path.starts_with("host-sim/")) {
        let Ok(file) = syn::parse_file(text) else { continue };
        let enums = file.items.iter().filter_map(|item| match item {
            syn::Item::Enum(item) if derives(&item.attrs, "Subcommand") => Some(item),
            _ => None,
        });
        for variant in enums.flat_map(|item| &item.variants) {
            calls.insert(format!("host-sim {}", kebab_case(&variant.ident.to_string())));
        }
    }
    let usage = repository.text(XTASK).unwrap_or_default().lines();
    let listed = usage.skip_while(|line| !line.contains("Usage:")).take_while(|line| *line != "\";");
    for line in listed.filter_map(|line| line.strip_prefix("  ")).filter(|line| !line.starts_with(' ')) {
        let name = line.split_whitespace().next().unwrap_or_default();
        if name != "help" {
            calls.insert(format!("cargo xtask {name}"));
        }
    }
    let missing = calls.into_iter().filter(|call| !documents.iter().any(|document| document.has_word(call)));
    missing.map(|call| format!("`{call}` stands in no document: add it to README.md or to docs/")).collect()
}

fn derives(attributes: &[syn::Attribute], name: &str) -> bool {
    attributes.iter().any(|attribute| {
        let syn::Meta::List(list) = &attribute.meta else { return false };
        list.path.is_ident("derive")
            && list.tokens.to_string().split(|c: char| !c.is_alphanumeric()).any(|word| word == name)
    })
}

fn kebab_case(name: &str) -> String {
    let mut text = String::new();
    for c in name.chars() {
        if c.is_uppercase() && !text.is_empty() {
            text.push('-');
        }
        text.extend(c.to_lowercase());
    }
    text
}

/// Names that the firmware reports (`fn name` of faults, reasons, causes) and no document explains.
pub fn undocumented_names(repository: &Repository, documents: &[Document]) -> Vec<String> {
    let mut complaints = Vec::new();
    for (path, text) in repository.with_extension("rs").filter(|(path, _)| path.starts_with("firmware/")) {
        let Ok(file) = syn::parse_file(text) else { continue };
        let mut names = ReportedNames::default();
        names.visit_file(&file);
        for (line, name) in names.found {
            let has = |document: &&Document| document.path.starts_with("docs/") && document.has_word(&name);
            if !documents.iter().any(|document| has(&document)) {
                complaints.push(format!(
                    "{path}:{line}: `{name}` is reported to users and stands in no document of docs/"
                ));
            }
        }
    }
    complaints
}

/// Texts that functions called `name` return.
#[derive(Default)]
struct ReportedNames {
    is_inside: bool,
    found: Vec<(usize, String)>,
}

impl<'ast> Visit<'ast> for ReportedNames {
    fn visit_impl_item_fn(&mut self, function: &'ast syn::ImplItemFn) {
        if function.sig.ident == "name" {
            self.is_inside = true;
            visit::visit_block(self, &function.block);
            self.is_inside = false;
        }
    }

    fn visit_lit_str(&mut self, text: &'ast syn::LitStr) {
        if self.is_inside {
            self.found.push((text.span().start().line, text.value()));
        }
    }
}

/// Numbers before the word `scenarios` that are not how many are shipped.
pub fn wrong_counts(repository: &Repository, documents: &[Document]) -> Vec<String> {
    let shipped = repository.paths().filter(|path| path.starts_with(SCENARIOS)).count();
    let mut complaints = Vec::new();
    for document in documents {
        for (at, line) in document.text.lines().enumerate() {
            let words: Vec<&str> = line.split_whitespace().collect();
            for pair in words
                .windows(2)
                .filter(|pair| pair[1].trim_end_matches(['.', ',', ':', ';', ')']) == "scenarios")
            {
                if number(pair[0]).is_some_and(|stated| stated != shipped) {
                    complaints.push(format!(
                        "{}:{}: `{} scenarios`, but {SCENARIOS} has {shipped}",
                        document.path,
                        at + 1,
                        pair[0]
                    ));
                }
            }
        }
    }
    complaints
}

fn number(word: &str) -> Option<usize> {
    const WORDS: [&str; 21] = [
        "zero",
        "one",
        "two",
        "three",
        "four",
        "five",
        "six",
        "seven",
        "eight",
        "nine",
        "ten",
        "eleven",
        "twelve",
        "thirteen",
        "fourteen",
        "fifteen",
        "sixteen",
        "seventeen",
        "eighteen",
        "nineteen",
        "twenty",
    ];
    let word = word.to_lowercase();
    word.parse().ok().or_else(|| WORDS.iter().position(|known| *known == word))
}

/// Calls of `cargo test` with a package or a test that the workspace does not have.
pub fn missing_tests(packages: &[PackageMetadata], documents: &[Document]) -> Vec<String> {
    let has_test = |package: Option<&str>, test: &str| {
        packages
            .iter()
            .filter(|known| package.is_none_or(|name| known.name == name))
            .flat_map(|known| &known.targets)
            .any(|target| target.name == test && target.kind.iter().any(|kind| kind == "test"))
    };
    let mut complaints = Vec::new();
    for document in documents {
        for (at, line) in document.text.lines().enumerate() {
            let words: Vec<&str> =
                line.split(|c: char| c.is_whitespace() || c == '`').filter(|word| !word.is_empty()).collect();
            let mut package = None;
            for pair in words.windows(2) {
                let name = pair[1].trim_end_matches(['.', ',', ':', ';', ')']);
                let is_missing = match pair[0] {
                    "-p" => {
                        package = Some(name);
                        !packages.iter().any(|known| known.name == name)
                    }
                    "--test" => !has_test(package, name),
                    _ => false,
                };
                if is_missing {
                    complaints.push(format!(
                        "{}:{}: `{} {name}` names no package or test of the workspace",
                        document.path,
                        at + 1,
                        pair[0]
                    ));
                }
            }
        }
    }
    complaints
}
