//! The full test run: every stage, even after one has failed, then one closing line with the counts.

mod counts;

use std::process::ExitCode;
use std::time::Instant;

use anyhow::{Result, bail, ensure};

use crate::budgets::{self, BudgetLimits};
use crate::command::CommandLine;
use crate::firmware::{on_board, on_target};
use crate::workspace::{Package, TARGET, Workspace};
use crate::{panic_path, setup, source_check};
use counts::{LibtestReader, TestCounts};

/// Counts and failed stages so far.
struct TestRun {
    counts: TestCounts,
    failed_stages: Vec<&'static str>,
}

impl TestRun {
    /// Runs a check, counted as one test.
    fn check(&mut self, name: &'static str, check: impl FnOnce() -> Result<()>) {
        self.stage(name, |counts| {
            let result = check();
            match result {
                Ok(()) => counts.passed += 1,
                Err(_) => counts.failed += 1,
            }
            result
        });
    }

    /// Runs a stage that counts its own tests.
    fn stage(&mut self, name: &'static str, stage: impl FnOnce(&mut TestCounts) -> Result<()>) {
        println!("\n==== {name}");
        let started = Instant::now();
        let result = stage(&mut self.counts);
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
    let mut run = TestRun { counts: TestCounts::default(), failed_stages: Vec::new() };

    run.check("format", || CommandLine::cargo(&["fmt", "--all", "--check"]).check());
    run.check("arrows between crates and modules", || source_check::arrows(&workspace));
    run.check("documents against the sources", || source_check::docs(&workspace));
    run.check("one name, one meaning", || source_check::names(&workspace));
    // Firmware first: the end-to-end tests need its ELF.
    run.check("firmware builds, release", || build_firmware(&workspace, &["build", "--release"]));
    run.check("no panic path in the estimator", panic_path::absent);
    run.check("a panic path would be detected", panic_path::would_be_detected);
    run.check("lints, firmware", || lint_firmware(&workspace));
    run.check("firmware builds, debug", || build_firmware(&workspace, &["build"]));
    run.check("lints, host", || lint_host(&workspace));
    run.stage("host and QEMU tests", |counts| host_tests(&workspace, counts));
    run.check("enough tests were executed", {
        let executed = run.counts.executed_by_cargo;
        move || enough(executed)
    });
    run.check("documentation", || document(&workspace));
    run.check("budgets", || within_budgets(&workspace));

    println!();
    for skipped in &run.counts.skipped_because {
        println!("!!!! {skipped}");
    }
    if !run.failed_stages.is_empty() {
        println!("failed: {}", run.failed_stages.join(", "));
    }
    println!("{}", run.counts.summary());
    Ok(if run.failed_stages.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Builds every firmware crate for its target: libraries with the firmware's profile, then each board.
fn build_firmware(workspace: &Workspace, args: &[&str]) -> Result<()> {
    selecting(on_target(args), workspace.firmware_libraries()).check()?;
    for board in workspace.below("firmware/boards") {
        on_board(board, args).check()?;
    }
    Ok(())
}

/// Lints everything that compiles for the target. In release, because that profile's build scripts and macros are built
/// already.
fn lint_firmware(workspace: &Workspace) -> Result<()> {
    let deny = ["--", "-D", "warnings"];
    let clippy = on_target(&["clippy", "--release", "--target", TARGET]);
    let packages = workspace.firmware_libraries().chain(workspace.target_checks());
    selecting(clippy, packages).args(deny).check()?;
    for board in workspace.below("firmware/boards") {
        on_board(board, &["clippy", "--release"]).args(deny).check()?;
    }
    Ok(())
}

fn lint_host(workspace: &Workspace) -> Result<()> {
    CommandLine::cargo(&["clippy", "--all-targets"])
        .args(workspace.host_selection())
        .args(["--", "-D", "warnings"])
        .check()
}

/// Builds the documentation twice: with private items, because most modules are private, and without, because only then
/// rustdoc reports links from public items to private ones.
fn document(workspace: &Workspace) -> Result<()> {
    for args in [&["doc", "--no-deps", "--document-private-items"][..], &["doc", "--no-deps"]] {
        CommandLine::cargo(args)
            .args(workspace.host_selection())
            .env("RUSTDOCFLAGS", "-D warnings")
            .check()?;
    }
    Ok(())
}

/// Runs all tests of the host packages, the end-to-end tests in QEMU included.
fn host_tests(workspace: &Workspace, counts: &mut TestCounts) -> Result<()> {
    let failed_before = counts.failed;
    let mut reader = LibtestReader::default();
    let status = CommandLine::cargo(&["test", "--no-fail-fast"])
        .args(workspace.host_selection())
        // Skipped tests print their reason, and libtest hides the output of tests that pass.
        .args(["--", "--show-output"])
        .each_line(|line| {
            if reader.push(line) {
                println!("{line}");
            }
        })?;
    counts.add(reader);
    if status.success() {
        return Ok(());
    }
    if counts.failed == failed_before {
        // No test failed: the build did, or a test binary crashed.
        counts.failed += 1;
    }
    bail!("`cargo test` failed ({status})")
}

/// Adds `-p NAME` for each package.
fn selecting<'a>(command: CommandLine, packages: impl Iterator<Item = &'a Package>) -> CommandLine {
    command.args(packages.flat_map(|package| ["-p", &package.name]))
}

fn enough(executed: u64) -> Result<()> {
    let least = BudgetLimits::load()?.min_tests;
    ensure!(
        executed >= least,
        "{executed} tests were executed, fewer than tests.min_executed = {least} of xtask/limits.toml. If tests were \
         removed on purpose, lower it there"
    );
    println!("{executed} executed, at least {least} required");
    Ok(())
}

fn within_budgets(workspace: &Workspace) -> Result<()> {
    let complaints = budgets::complaints(workspace)?;
    ensure!(complaints.is_empty(), "\n  {}", complaints.join("\n  "));
    Ok(())
}
