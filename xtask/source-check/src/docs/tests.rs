//! The document check on small documents.

use super::facts;
use super::markdown::Document;
use crate::files::Repository;
use crate::packages::PackageMetadata;

fn complaints(files: &[(&'static str, &'static str)]) -> Vec<String> {
    let repository: Repository = files.iter().copied().collect();
    let documents: Vec<Document> =
        repository.with_extension("md").map(|(path, text)| Document::parse(path, text)).collect();
    super::complaints(&repository, &documents)
}

fn one_complaint(files: &[(&'static str, &'static str)], expected: &str) {
    let found = complaints(files);
    assert!(found.len() == 1 && found[0].contains(expected), "{found:?}");
}

#[test]
fn links_lead_to_files_and_headings() {
    let good = "# One, `two`!\n[here](#one-two) [there](docs/a.md#b-1) [folder](docs) [web](https://example.org/x#y)";
    assert_eq!(complaints(&[("README.md", good), ("docs/a.md", "# B\n# B\n[up](../README.md)")]), [""; 0]);
    one_complaint(&[("docs/a.md", "\n[gone](../b.md)")], "docs/a.md:2: the link `../b.md` leads to `b.md`");
    one_complaint(&[("a.md", "[gone](#nowhere)")], "no heading `#nowhere`");
    one_complaint(&[("a.md", "```\n# no heading\n```\n[gone](#no-heading)")], "no heading");
}

#[test]
fn paths_exist() {
    let source = ("xtask/src/full/shaft.rs", "");
    let good = "`xtask/src/full/shaft.rs` `full/shaft.rs` `xtask/src/full/` `xtask/*/full` `shaft.rs` `L/min` `df/dp`";
    assert_eq!(complaints(&[source, ("a.md", good)]), [""; 0]);
    one_complaint(&[source, ("a.md", "one\n`xtask/src/gone.rs`")], "a.md:2: `xtask/src/gone.rs`");
    one_complaint(&[source, ("a.md", "`full/gone.rs`")], "`full/gone.rs`");
    one_complaint(
        &[source, ("docs/a.md", ""), ("b.rs", "//! See `docs/gone.md`.")],
        "b.rs:1: `docs/gone.md`",
    );
}

#[test]
fn commands_are_documented() {
    let cli = ("host-sim/src/main.rs", "#[derive(Debug, Subcommand)] enum Command { PlotAll(Args) }");
    let xtask = (
        "xtask/src/main.rs",
        "const USAGE: &str = \"\\\nUsage: cargo xtask\n\n  demo [--x]   runs\n  help   this\";\n",
    );
    assert_eq!(
        complaints(&[cli, xtask, ("README.md", "    host-sim plot-all\n    cargo xtask demo")]),
        [""; 0]
    );
    one_complaint(&[cli, ("README.md", "`host-sim plot-allies`")], "`host-sim plot-all`");
    one_complaint(&[xtask, ("README.md", "")], "`cargo xtask demo`");
}

#[test]
fn reported_names_are_documented() {
    let names = (
        "firmware/a.rs",
        "impl Fault {\nfn name(self) -> &'static str { match self { Self::Open => \"open_wire\" } } }",
    );
    assert_eq!(complaints(&[names, ("docs/a.md", "| `open_wire` |")]), [""; 0]);
    one_complaint(&[names, ("docs/a.md", "`open_wires`")], "firmware/a.rs:2: `open_wire`");
}

#[test]
fn counts_of_scenarios_are_right() {
    let scenario = ("host-sim/scenarios/a.toml", "");
    assert_eq!(complaints(&[scenario, ("a.md", "one scenarios, 1 scenarios, long scenarios")]), [""; 0]);
    one_complaint(&[scenario, ("a.md", "the sixteen scenarios.")], "a.md:1: `sixteen scenarios`");
}

#[test]
fn prose_wraps_and_tables_do_not() {
    let long = "word ".repeat(25);
    let document = |text: &str| Document::parse("a.md", text).long_lines(120);
    assert_eq!(document(&format!("fine\n{long}")), ["a.md:2: 125 columns; prose wraps at 120"]);
    assert_eq!(document(&format!("| a |\n|---|\n| {long} |\n\n```\n{long}\n```\n\n    {long}")), [""; 0]);
    assert_eq!(document(&format!("[link](https://example.org/{})", "x".repeat(120))), [""; 0]);
}

#[test]
fn named_tests_and_packages_exist() {
    let packages: Vec<PackageMetadata> = serde_json::from_str(
        r#"[{"name": "demo", "manifest_path": "Cargo.toml", "dependencies": [],
            "targets": [{"kind": ["test"], "name": "storage", "src_path": "storage.rs"}]}]"#,
    )
    .unwrap();
    let complaints = |text: &str| facts::missing_tests(&packages, &[Document::parse("a.md", text)]);
    assert_eq!(complaints("`cargo test -p demo --test storage`; cargo test --test storage"), [""; 0]);
    for wrong in ["-p demos --test storage", "-p demo --test storages", "--test storages."] {
        assert_eq!(complaints(wrong).len(), 1 + usize::from(wrong.contains("demos")), "{wrong}");
    }
}
