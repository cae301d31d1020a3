//! The name check on small source texts.

use super::rules::NameRules;
use super::{terms, types};
use crate::files::Repository;

fn repeated(rules: &str, files: &[(&'static str, &'static str)]) -> Vec<String> {
    let repository: Repository = files.iter().copied().collect();
    types::repeated(&repository, &toml::from_str::<NameRules>(rules).unwrap()).unwrap().0
}

fn found(rules: &str, files: &[(&'static str, &'static str)]) -> Vec<String> {
    let repository: Repository = files.iter().copied().collect();
    terms::found(&repository, &toml::from_str::<NameRules>(rules).unwrap()).unwrap()
}

#[test]
fn a_type_name_that_stands_twice_is_reported_with_both_places() {
    let files =
        [("a.rs", "struct Report;"), ("b.rs", "mod m {\n fn f() { enum Report { A } } }\ntype Error = u8;")];
    let complaints = repeated("", &files);
    assert_eq!(complaints.len(), 1, "{complaints:?}");
    assert!(complaints[0].contains("`Report` stands 2 times: a.rs:1, b.rs:2"), "{complaints:?}");
}

#[test]
fn associated_types_and_allowed_names_may_repeat() {
    let files = [
        ("a.rs", "struct Args; impl Iterator for Args { type Item = u8; }"),
        ("b.rs", "struct Args; struct B; impl Iterator for B { type Item = u8; } enum Item { Args }"),
    ];
    assert_eq!(repeated("repeated = { Args = 'one for each command' }", &files), [""; 0]);
    assert_eq!(repeated("repeated = { Item = '', Args = '' }", &files).len(), 1);
}

#[test]
fn words_are_found_in_identifiers_comments_and_documents() {
    let rules = "[words]\ndeficit = 'ratio_residual'";
    for (path, text) in [
        ("a.rs", "fn ratio_deficit() {}"),
        ("a.rs", "struct RatioDeficit;"),
        ("a.rs", "const DEFICIT: u8 = 0;"),
        ("a.rs", "/// A deficit.\nstruct A;"),
        ("a.rs", "fn f() { println!(\"{}\", deficit); }"),
        ("a.md", "The deficit."),
    ] {
        let complaints = found(rules, &[(path, text)]);
        assert!(
            complaints.len() == 1
                && complaints[0].contains(":1: ")
                && complaints[0].ends_with("is: ratio_residual"),
            "{text}"
        );
    }
    assert_eq!(
        found(rules, &[("a.rs", "fn deficits() { \"deficit\"; }"), ("a.toml", "deficit = 1")]),
        [""; 0]
    );
}

#[test]
fn identifiers_are_compared_to_the_letter() {
    let rules = "[identifiers]\nPace = 'Ticker'";
    assert_eq!(
        found(rules, &[("a.rs", "struct Pace;")]),
        ["a.rs:1: `Pace`: the standard term for `Pace` is: Ticker"]
    );
    assert_eq!(
        found(rules, &[("a.rs", "/// Pace.\nstruct PaceMaker; fn pace() {}"), ("a.md", "Pace")]),
        [""; 0]
    );
}

#[test]
fn exceptions_hold_where_they_are_made_and_must_be_needed() {
    let rules = "[identifiers]\nPace = 'Ticker'\n[[except]]\nword = 'Pace'\npath = 'a/'\nreason = 'a format'";
    assert_eq!(found(rules, &[("a/a.rs", "struct Pace;")]), [""; 0]);
    assert_eq!(found(rules, &[("b/a.rs", "struct Pace;")]).len(), 2);
}
