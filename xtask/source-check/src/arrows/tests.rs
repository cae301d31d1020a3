//! The arrow check on small source texts.

use std::collections::BTreeMap;
use std::path::Path;

use super::rules::Rules;
use super::{circles, edges};
use crate::module_tree::{ModuleTree, Sources};

/// Source files in memory.
struct Texts(BTreeMap<&'static str, &'static str>);

impl Sources for Texts {
    fn text(&self, path: &Path) -> Option<String> {
        self.0.get(path.to_str()?).map(|text| (*text).to_owned())
    }
}

fn tree(files: &[(&'static str, &'static str)]) -> ModuleTree {
    let mut tree = ModuleTree::default();
    tree.add_crate("demo", true, Path::new("lib.rs"), &Texts(files.iter().copied().collect())).unwrap();
    tree
}

fn circles_in(files: &[(&'static str, &'static str)]) -> Vec<String> {
    let tree = tree(files);
    circles::complaints(&tree, &edges::edges(&tree))
}

/// Complaints about `demo::low -> demo::high`.
fn forbidden_in(files: &[(&'static str, &'static str)]) -> Vec<String> {
    let tree = tree(files);
    let rule = "[[module]]\nfrom = 'demo::low'\nto = ['demo::high']\nreason = 'low is lower'\ninstead = 'turn it round'";
    Rules::parse(rule).unwrap().module_complaints(&tree, &edges::edges(&tree))
}

/// `low` as given, below a `high` that defines `Item`.
fn low(text: &'static str) -> Vec<String> {
    forbidden_in(&[
        ("lib.rs", "mod low; mod high; pub use high::Item as Renamed;"),
        ("low.rs", text),
        ("high.rs", "pub struct Item; pub mod deep { pub struct Inner; }"),
    ])
}

#[test]
fn a_circle_of_two_files_is_reported_with_its_whole_way() {
    let complaints = circles_in(&[
        ("lib.rs", "mod a; mod b; mod c;"),
        ("a.rs", "use crate::b::B;\npub struct A(B);"),
        ("b.rs", "\nuse crate::c::C;\npub struct B(C);"),
        ("c.rs", "use super::a::A;\npub struct C(A);"),
    ]);
    assert_eq!(complaints.len(), 1, "{complaints:?}");
    for part in ["3 files", "a.rs -> b.rs -> c.rs -> a.rs", "b.rs:2 -> c.rs: `crate::c::C`"] {
        assert!(complaints[0].contains(part), "`{part}` is missing in {}", complaints[0]);
    }
}

#[test]
fn a_facade_closes_no_circle() {
    let complaints = circles_in(&[
        ("lib.rs", "mod shape;\npub use shape::Shape;"),
        (
            "shape/mod.rs",
            "mod round;\nmod square;\npub use round::*;\npub use square::Square;\npub trait Shape {}",
        ),
        ("shape/round.rs", "use super::Shape; pub struct Round; impl Shape for Round {}"),
        (
            "shape/square.rs",
            "use crate::Shape; use super::Round; pub struct Square(Round); impl Shape for Square {}",
        ),
    ]);
    assert!(complaints.is_empty(), "{complaints:?}");
}

#[test]
fn a_facade_that_uses_what_it_re_exports_closes_a_circle() {
    let complaints = circles_in(&[
        ("lib.rs", "mod shape;"),
        ("shape/mod.rs", "mod round; pub use round::Round; pub struct Size; pub fn all(_: Round) {}"),
        ("shape/round.rs", "pub struct Round(super::Size);"),
    ]);
    assert_eq!(complaints.len(), 1, "{complaints:?}");
}

#[test]
fn modules_of_several_files_close_a_circle_that_no_files_close() {
    let complaints = circles_in(&[
        ("lib.rs", "mod left; mod right;"),
        ("left/mod.rs", "mod one; mod two;"),
        ("left/one.rs", "pub struct One(crate::right::Low);"),
        ("left/two.rs", "pub struct Two;"),
        ("right/mod.rs", "mod high; mod low; pub use low::Low;"),
        ("right/high.rs", "pub struct High(crate::left::two::Two);"),
        ("right/low.rs", "pub struct Low;"),
    ]);
    assert_eq!(complaints.len(), 1, "{complaints:?}");
    assert!(
        complaints[0].contains("2 modules") && complaints[0].contains("demo::left -> demo::right"),
        "{complaints:?}"
    );
}

#[test]
fn inline_modules_and_methods_are_no_arrows() {
    let complaints = circles_in(&[
        ("lib.rs", "mod a; pub struct Root; pub fn run() { a::start().stop(); }"),
        (
            "a.rs",
            "pub struct A; pub fn start() -> A { A } impl A { pub fn stop(&self) {} } mod inner { use super::A; struct B(A); }",
        ),
    ]);
    assert!(complaints.is_empty(), "{complaints:?}");
}

#[test]
fn an_import_is_reported_with_place_reason_and_remedy() {
    let complaints = low("//! Docs.\nuse crate::high::Item;\nstruct Low(Item);");
    assert_eq!(complaints.len(), 1, "{complaints:?}");
    for part in ["low.rs:2:", "`crate::high::Item`", "low is lower", "Instead: turn it round"] {
        assert!(complaints[0].contains(part), "`{part}` is missing in {}", complaints[0]);
    }
}

#[test]
fn every_spelling_of_an_import_is_noticed() {
    for text in [
        "use crate::{high::{deep::{self, Inner}, Item}};",
        "use crate::high as other; struct Low(other::Item);",
        "use super::high; fn f(_: &high::Item) {}",
        "use crate::high::*; struct Low(Item);",
        "use crate::high::Item as Thing; struct Low(Thing);",
        "pub(crate) use crate::high::Item;",
        "use crate::Renamed; struct Low(Renamed);",
        "use demo::high::Item; struct Low(Item);",
        "mod inner { use super::super::high::Item; struct Low(Item); }",
        "fn f() { use crate::high::Item; let _ = Item; }",
    ] {
        assert!(!low(text).is_empty(), "{text}");
    }
}

#[test]
fn paths_without_an_import_are_noticed() {
    for text in [
        "struct Low(Option<crate::high::Item>);",
        "fn f() { let _ = crate::high::Item; }",
        "fn f() { println!(\"{:?}\", crate::high::Item); }",
        "fn f(x: u8) { match x { 0 => assert!(matches!(y, super::high::deep::Inner)), _ => {} } }",
        "impl From<crate::high::Item> for Low {}",
        "macro_rules! m { () => { $crate::high::Item } }",
        "#[serde(with = \"crate::high::Item\")] struct Low;",
    ] {
        assert_eq!(low(text).len(), 1, "{text}");
    }
}

#[test]
fn tests_comments_and_names_that_only_look_alike_are_left_alone() {
    for text in [
        "#[cfg(test)] mod tests { use crate::high::Item; fn f(_: Item) {} }",
        "#[cfg(test)] use crate::high::Item;",
        "#[test] fn f() { let _ = crate::high::Item; }",
        "/// As [`crate::high::Item`].\nstruct Low;",
        "struct Item; fn f(_: Item) {}",
        "use other::high::Item; struct Low(Item);",
        "fn f(x: Thing) { x.high.Item(); }",
        "fn f() { println!(\"crate high Item {}\", x.Item); }",
    ] {
        assert_eq!(low(text), Vec::<String>::new(), "{text}");
    }
}

#[test]
fn a_rule_about_a_module_that_does_not_exist_is_reported() {
    let complaints = forbidden_in(&[("lib.rs", "mod low;"), ("low.rs", "")]);
    assert!(
        complaints.len() == 1 && complaints[0].contains("`demo::high`, which does not exist"),
        "{complaints:?}"
    );
}

#[test]
fn files_are_found_as_the_compiler_finds_them() {
    let tree = tree(&[
        ("lib.rs", "mod a; mod b; mod inline { mod c; } #[path = \"elsewhere.rs\"] mod d;"),
        ("a.rs", "mod below;"),
        ("a/below.rs", ""),
        ("b/mod.rs", "mod below;"),
        ("b/below.rs", ""),
        ("inline/c.rs", ""),
        ("elsewhere.rs", ""),
    ]);
    for path in ["demo::a::below", "demo::b::below", "demo::inline::c", "demo::d"] {
        assert!(tree.has(path), "{path}");
    }
}

#[test]
fn a_private_import_that_nothing_names_closes_a_circle() {
    let complaints = circles_in(&[
        ("lib.rs", "mod a; mod b;"),
        ("a.rs", "use crate::b::B as _;\npub struct A;"),
        ("b.rs", "use crate::a::A;\npub struct B(A);"),
    ]);
    assert_eq!(complaints.len(), 1, "{complaints:?}");
}
