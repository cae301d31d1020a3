//! Words for which the field has a standard term.

use anyhow::Result;
use proc_macro2::{TokenStream, TokenTree};

use super::rules::{FILE, NameRules, Term, TermException};
use crate::files::Repository;

/// Complaints about every such word, and about exceptions without use.
pub fn found(repository: &Repository, rules: &NameRules) -> Result<Vec<String>> {
    let mut uses = Vec::new();
    for (path, text) in repository.with_extension("rs") {
        let tokens: TokenStream = text.parse().map_err(|error| anyhow::anyhow!("{path}: {error}"))?;
        identifiers(tokens, &mut |name, line| {
            for term in &rules.terms {
                let is_identifier = term.identifiers.iter().any(|word| word == name);
                let word = words_of(name).into_iter().find(|word| term.words.contains(word));
                if let Some(word) = word.or_else(|| is_identifier.then(|| name.to_owned())) {
                    uses.push(Use { path: path.to_owned(), line, name: name.to_owned(), word, term });
                }
            }
        });
        let lines = text.lines().enumerate().filter(|(_, line)| line.trim_start().starts_with("//"));
        prose(path, lines, rules, &mut uses);
    }
    for (path, text) in repository.with_extension("md") {
        prose(path, text.lines().enumerate(), rules, &mut uses);
    }
    let mut complaints = Vec::new();
    let mut is_needed = vec![false; rules.exceptions.len()];
    for found in uses {
        let except = |exception: &&TermException| {
            exception.word == found.word && found.path.starts_with(&exception.path)
        };
        match rules.exceptions.iter().position(|exception| except(&exception)) {
            Some(at) => is_needed[at] = true,
            None => complaints.push(format!(
                "{}:{}: `{}`: say {}",
                found.path, found.line, found.name, found.term.standard
            )),
        }
    }
    for (exception, _) in rules.exceptions.iter().zip(is_needed).filter(|(_, needed)| !needed) {
        let (word, path) = (&exception.word, &exception.path);
        complaints
            .push(format!("{FILE} excepts `{word}` in {path}, where it does not stand: remove it there"));
    }
    complaints.dedup();
    Ok(complaints)
}

/// A place where a word stands.
struct Use<'a> {
    path: String,
    line: usize,
    name: String,
    word: String,
    term: &'a Term,
}

/// Words in lines of text.
fn prose<'a, 'b>(
    path: &str,
    lines: impl Iterator<Item = (usize, &'b str)>,
    rules: &'a NameRules,
    uses: &mut Vec<Use<'a>>,
) {
    for (at, line) in lines {
        for name in line.split(|c: char| !c.is_alphanumeric() && c != '_') {
            for term in &rules.terms {
                if let Some(word) = words_of(name).into_iter().find(|word| term.words.contains(word)) {
                    uses.push(Use { path: path.to_owned(), line: at + 1, name: name.to_owned(), word, term });
                }
            }
        }
    }
}

/// Calls `each` with every identifier and its line.
fn identifiers(tokens: TokenStream, each: &mut impl FnMut(&str, usize)) {
    for token in tokens {
        match token {
            TokenTree::Group(group) => identifiers(group.stream(), each),
            TokenTree::Ident(ident) => each(&ident.to_string(), ident.span().start().line),
            _ => {}
        }
    }
}

/// Words of an identifier in lower case: `ratio_deficit`, `RatioDeficit` and `RATIO_DEFICIT` have two.
fn words_of(name: &str) -> Vec<String> {
    let mut words: Vec<String> = vec![String::new()];
    let mut before = '_';
    for c in name.chars() {
        if c == '_' || (c.is_uppercase() && before.is_lowercase()) {
            words.push(String::new());
        }
        if let Some(word) = words.last_mut().filter(|_| c != '_') {
            word.extend(c.to_lowercase());
        }
        before = c;
    }
    words.retain(|word| !word.is_empty());
    words
}
