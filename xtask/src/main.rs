//! One entry for people and CI: set-up, demo, tests, budgets.
//!
//! Every command does its own set-up, so each of them works on a machine that has only rustup and a C compiler, and
//! works again without a network once it has run.

mod budgets;
mod command;
mod demo;
mod firmware;
mod folders;
mod host_sim;
mod panic_path;
mod setup;
mod source_check;
mod test;
mod workspace;

use std::process::ExitCode;

use anyhow::{Result, bail};

use workspace::Workspace;

const USAGE: &str = "\
Usage: cargo xtask <command>

  setup            add the compiler's target and components, find or install QEMU, fetch all crates
  demo             the main job: identify a calibration, replay a log on the host and in firmware, compare every bit
  test             everything: format, lints, docs, host tests, firmware builds, QEMU tests, panic paths, budgets
  budgets [--json] instructions, bytes and stack of the firmware against xtask/limits.toml
  arrows           forbidden dependencies between crates and modules (xtask/arrows.toml), and circles of imports
  docs             links, paths, commands and names in README.md and docs/ against the sources
  names            type names that stand more than once, and words for which there is a standard term (xtask/names.toml)
  stacks           which functions take the deepest stack: of the estimator, and of the vehicle's firmware by executor
  help             this text";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let args: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match run(&args) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(args: &[&str]) -> Result<ExitCode> {
    match args {
        ["setup"] => setup::run()?,
        ["demo"] => demo::run()?,
        ["test"] => return test::run(),
        ["budgets"] => return budgets::run(false),
        ["budgets", "--json"] => return budgets::run(true),
        ["arrows"] => source_check::arrows(&Workspace::load()?)?,
        ["docs"] => source_check::docs(&Workspace::load()?)?,
        ["names"] => source_check::names(&Workspace::load()?)?,
        ["stacks"] => budgets::stacks()?,
        [] | ["help" | "--help" | "-h"] => println!("{USAGE}"),
        other => bail!("`{}` is not a command of xtask\n\n{USAGE}", other.join(" ")),
    }
    Ok(ExitCode::SUCCESS)
}
