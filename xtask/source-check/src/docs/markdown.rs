//! A Markdown document: its headings, links, code spans and the lines that may not be wrapped.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use pulldown_cmark::{Event, Options, Parser, Tag, TagEnd};

/// Content of a document that the checks use.
#[derive(Debug)]
pub struct Document {
    /// Path below the workspace's root.
    pub path: String,
    /// Text as it stands in the file.
    pub text: String,
    /// Anchors of the headings, as forges make them.
    pub anchors: BTreeSet<String>,
    /// Line and target of each link and picture.
    pub links: Vec<(usize, String)>,
    /// Line and text of each piece of code within a line.
    pub code: Vec<(usize, String)>,
    /// Lines of tables and code blocks.
    unwrapped: BTreeSet<usize>,
}

impl Document {
    /// Reads a document.
    pub fn parse(path: &str, text: &str) -> Self {
        let mut document = Self {
            path: path.to_owned(),
            text: text.to_owned(),
            anchors: BTreeSet::new(),
            links: Vec::new(),
            code: Vec::new(),
            unwrapped: BTreeSet::new(),
        };
        let starts: Vec<usize> =
            std::iter::once(0).chain(text.match_indices('\n').map(|(at, _)| at + 1)).collect();
        let line_of = |at: usize| starts.partition_point(|start| *start <= at);
        let lines_of = |range: &Range<usize>| line_of(range.start)..=line_of(range.end.saturating_sub(1));
        let mut heading: Option<String> = None;
        let mut times: BTreeMap<String, usize> = BTreeMap::new();
        let options = Options::ENABLE_TABLES | Options::ENABLE_STRIKETHROUGH | Options::ENABLE_FOOTNOTES;
        for (event, range) in Parser::new_ext(text, options).into_offset_iter() {
            match &event {
                Event::Start(Tag::Heading { .. }) => heading = Some(String::new()),
                Event::End(TagEnd::Heading(_)) => {
                    let slug = slug(&heading.take().unwrap_or_default());
                    let count = times.entry(slug.clone()).or_default();
                    let anchor = if *count == 0 { slug } else { format!("{slug}-{count}") };
                    *count += 1;
                    document.anchors.insert(anchor);
                }
                Event::Start(Tag::Table(_) | Tag::CodeBlock(_)) => {
                    document.unwrapped.extend(lines_of(&range))
                }
                Event::Start(Tag::Link { dest_url, .. } | Tag::Image { dest_url, .. }) => {
                    document.links.push((line_of(range.start), dest_url.to_string()));
                }
                Event::Code(code) => document.code.push((line_of(range.start), code.to_string())),
                _ => {}
            }
            if let (Some(heading), Event::Text(text) | Event::Code(text)) = (&mut heading, &event) {
                heading.push_str(text);
            }
        }
        document
    }

    /// Lines of prose that are longer than `max`, the targets of links and bare addresses not counted.
    pub fn long_lines(&self, max: usize) -> Vec<String> {
        let lines = self.text.lines().enumerate().map(|(at, line)| (at + 1, line));
        let long = lines.filter(|(number, line)| !self.unwrapped.contains(number) && columns(line) > max);
        long.map(|(number, line)| {
            let columns = columns(line);
            format!("{}:{number}: {columns} columns; prose wraps at {max}", self.path)
        })
        .collect()
    }

    /// True when the text has a word, by itself or within code.
    pub fn has_word(&self, word: &str) -> bool {
        self.text.match_indices(word).any(|(at, _)| {
            let is_part = |c: char| c.is_alphanumeric() || c == '_';
            let before = self.text[..at].chars().next_back().is_some_and(is_part);
            let after = self.text[at + word.len()..].chars().next().is_some_and(is_part);
            !before && !after
        })
    }
}

/// Anchor of a heading: lower case, words joined by hyphens, no other punctuation.
fn slug(heading: &str) -> String {
    let kept = heading.chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c));
    kept.map(|c| if c == ' ' { '-' } else { c }).flat_map(char::to_lowercase).collect()
}

/// Characters of a line without link targets and addresses.
fn columns(line: &str) -> usize {
    let mut counted = 0;
    let mut rest = line;
    while let Some(at) = rest.find("](") {
        counted += rest[..at].chars().count() + 1;
        rest = rest[at..].split_once(')').map_or("", |(_, after)| after);
    }
    let addresses: usize =
        rest.split_whitespace().filter(|word| word.contains("://")).map(|word| word.chars().count()).sum();
    counted + rest.chars().count() - addresses
}
