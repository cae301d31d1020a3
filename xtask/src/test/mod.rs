//! The whole test run: every stage, even after one has failed, then one closing line that counts everything.

mod tally;

use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Result, bail, ensure};

use crate::budgets::{self, Limits};
use crate::command::Run;
use crate::firmware::{on_board, on_target};
use crate::workspace::{TARGET, Workspace};
use crate::{panic_path, setup, source_check};
use tally::Tally;

/// What has passed and failed so far.
struct Report {
    tally: Tally,
    failed_stages: Vec<&'static str>,
}

impl Report {
    /// Runs a check that counts as one test.
    fn check(&mut self, name: &'static str, check: impl FnOnce() -> Result<()>) {
        self.stage(name, |tally| {
            let result = check();
            match result {
                Ok(()) => tally.passed += 1,
                Err(_) => tally.failed += 1,
            }
            result
        });
    }

    /// Runs a stage that counts its tests itself.
    fn stage(&mut self, name: &'static str, stage: impl FnOnce(&mut Tally) -> Result<()>) {
        println!("\n==== {name}");
        let started = Instant::now();
        let result = stage(&mut self.tally);
        let seconds = started.elapsed().as_secs_f64();
        match result {
            Ok(()) => println!("==== {name}: passed in {seconds:.1} s"),
            Err(error) => {
                println!("==== {name}: FAILED after {seconds:.1} s: {error:#}");
                self.failed_stages.push(name);
            }
        }
    }
}

/// Sets up and runs everything.
pub fn run() -> Result<ExitCode> {
    setup::run()?;
    setup::browser();
    setup::cantools();
    let workspace = Workspace::load()?;
    let mut report = Report { tally: Tally::default(), failed_stages: Vec::new() };

    report.check("format", || Run::cargo(&["fmt", "--all", "--check"]).check());
    report.check("arrows between crates and modules", || source_check::arrows(&workspace));
    report.check("documents against the sources", || source_check::docs(&workspace));
    // Firmware first: the end-to-end tests need its ELF.
    report.check("firmware builds, release", || build_firmware(&workspace, &["build", "--release"]));
    report.check("no panic path in the estimator", panic_path::absent);
    report.check("a panic path would be noticed", panic_path::would_be_noticed);
    report.check("lints, firmware", || lint_firmware(&workspace));
    report.check("firmware builds, debug", || build_firmware(&workspace, &["build"]));
    report.check("lints, host", || lint_host(&workspace));
    report.stage("host and QEMU tests", |tally| host_tests(&workspace, tally));
    report.check("enough tests were executed", {
        let executed = report.tally.executed_by_cargo;
        move || enough(executed)
    });
    report.check("documentation", || document(&workspace));
    report.check("budgets", || within_budgets(&workspace));

    println!();
    for skipped in &report.tally.skipped_because {
        println!("!!!! {skipped}");
    }
    if !report.failed_stages.is_empty() {
        println!("failed: {}", report.failed_stages.join(", "));
    }
    println!("{}", report.tally.summary());
    Ok(if report.failed_stages.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Every firmware crate for its target: libraries with the firmware's profile, then each board.
fn build_firmware(workspace: &Workspace, words: &[&str]) -> Result<()> {
    on_target(words)
        .args(["-p", "kou-estimator", "-p", "kou-app", "-p", "kou-pil", "-p", "kou-emulation"])
        .check()?;
    for board in workspace.below("firmware/boards") {
        on_board(board, words).check()?;
    }
    Ok(())
}

/// Lints of what compiles for the target. In release, because that profile's build scripts and macros are there already.
fn lint_firmware(workspace: &Workspace) -> Result<()> {
    let deny = ["--", "-D", "warnings"];
    let libraries = ["-p", "kou-estimator", "-p", "kou-app", "-p", "kou-pil", "-p", "kou-emulation"];
    let mut checks = on_target(&["clippy", "--release", "--target", TARGET]).args(libraries);
    for check in workspace.below("firmware/checks") {
        checks = checks.args(["-p", &check.name]);
    }
    checks.args(deny).check()?;
    for board in workspace.below("firmware/boards") {
        on_board(board, &["clippy", "--release"]).args(deny).check()?;
    }
    Ok(())
}

fn lint_host(workspace: &Workspace) -> Result<()> {
    Run::cargo(&["clippy", "--all-targets"])
        .args(workspace.host_selection())
        .args(["--", "-D", "warnings"])
        .check()
}

/// Twice: with private items, because most modules are, and without, because only then are links from public items to
/// private ones noticed.
fn document(workspace: &Workspace) -> Result<()> {
    for words in [&["doc", "--no-deps", "--document-private-items"][..], &["doc", "--no-deps"]] {
        Run::cargo(words).args(workspace.host_selection()).env("RUSTDOCFLAGS", "-D warnings").check()?;
    }
    Ok(())
}

/// All tests of the host packages, the end-to-end tests in QEMU among them.
fn host_tests(workspace: &Workspace, tally: &mut Tally) -> Result<()> {
    let failed_before = tally.failed;
    let mut reader = tally::Reader::default();
    let status = Run::cargo(&["test", "--no-fail-fast"])
        .args(workspace.host_selection())
        // The output of tests that passed tells which of them were skipped.
        .args(["--", "--show-output"])
        .each_line(|line| {
            if reader.line(line) {
                println!("{line}");
            }
        })?;
    tally.add(reader);
    if status.success() {
        return Ok(());
    }
    if tally.failed == failed_before {
        // It did not come to the point of failing a test: it does not compile, or a test binary died.
        tally.failed += 1;
    }
    bail!("`cargo test` failed ({status})")
}

fn enough(executed: u64) -> Result<()> {
    let least = Limits::load()?.min_tests;
    ensure!(
        executed >= least,
        "{executed} tests were executed, fewer than tests.min_executed = {least} of xtask/limits.toml. If tests were \
         removed on purpose, lower it there"
    );
    println!("{executed} executed, at least {least} demanded");
    Ok(())
}

fn within_budgets(workspace: &Workspace) -> Result<()> {
    let complaints = budgets::complaints(workspace)?;
    ensure!(complaints.is_empty(), "\n  {}", complaints.join("\n  "));
    Ok(())
}
