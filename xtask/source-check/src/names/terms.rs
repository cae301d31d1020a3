//! Words for which the field has a standard term.

use anyhow::Result;
use proc_macro2::{TokenStream, TokenTree};

use super::rules::{FILE, NameRules, TermException};
use crate::files::Repository;

/// A place where a word stands.
struct TermUse<'a> {
    path: String,
    line: usize,
    name: String,
    /// The word or identifier of the rules.
    word: &'a str,
    standard: &'a str,
}

/// Complaints about every such word, and about exceptions without use.
pub fn found(repository: &Repository, rules: &NameRules) -> Result<Vec<String>> {
    let mut uses = Vec::new();
    for (path, text) in repository.with_extension("rs") {
        let tokens: TokenStream = text.parse().map_err(|error| anyhow::anyhow!("{path}: {error}"))?;
        identifiers(tokens, &mut |name, line| {
            let identifier = rules.identifiers.get_key_value(name);
            uses.extend(
                identifier.or_else(|| word_in(name, rules)).map(|found| use_of(path, line, name, found)),
            );
        });
        let is_comment = |(_, line): &(usize, &str)| line.trim_start().starts_with("//");
        uses.extend(in_prose(path, text.lines().enumerate().filter(is_comment), rules));
    }
    for (path, text) in repository.with_extension("md") {
        uses.extend(in_prose(path, text.lines().enumerate(), rules));
    }
    let mut complaints = Vec::new();
    let mut is_needed = vec![false; rules.exceptions.len()];
    for found in uses {
        let covers = |exception: &TermException| {
            exception.word == found.word && found.path.starts_with(&exception.path)
        };
        match rules.exceptions.iter().position(covers) {
            Some(at) => is_needed[at] = true,
            None => {
                let TermUse { path, line, name, word, standard } = found;
                complaints
                    .push(format!("{path}:{line}: `{name}`: the standard term for `{word}` is: {standard}"));
            }
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

fn use_of<'a>(
    path: &str,
    line: usize,
    name: &str,
    (word, standard): (&'a String, &'a String),
) -> TermUse<'a> {
    TermUse { path: path.to_owned(), line, name: name.to_owned(), word, standard }
}

/// The first word of a name that has a standard term.
fn word_in<'a>(name: &str, rules: &'a NameRules) -> Option<(&'a String, &'a String)> {
    words_of(name).iter().find_map(|word| rules.words.get_key_value(word))
}

/// Words in lines of text.
fn in_prose<'a>(
    path: &str,
    lines: impl Iterator<Item = (usize, &'a str)>,
    rules: &'a NameRules,
) -> Vec<TermUse<'a>> {
    let mut uses = Vec::new();
    for (at, line) in lines {
        for name in line.split(|c: char| !c.is_alphanumeric() && c != '_') {
            uses.extend(word_in(name, rules).map(|found| use_of(path, at + 1, name, found)));
        }
    }
    uses
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

/// Words of an identifier in lower case: `ratio_error`, `RatioError` and `RATIO_ERROR` have two.
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
