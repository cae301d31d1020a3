//! Set-up: installs what is missing and nothing else, so that a second run needs no network.

use std::time::Duration;

use anyhow::{Context, Result, bail};

use crate::command::CommandLine;
use crate::workspace::TARGET;

/// The emulator.
pub const QEMU: &str = "qemu-system-arm";

/// A package manager and its commands to install the emulator.
struct Manager {
    program: &'static str,
    /// Refreshes its lists; tried when the first install fails.
    refresh: &'static [&'static str],
    install: &'static [&'static str],
    needs_root: bool,
}

const MANAGERS: [Manager; 6] = [
    Manager {
        program: "apt-get",
        refresh: &["update"],
        install: &["install", "-y", "--no-install-recommends", "qemu-system-arm"],
        needs_root: true,
    },
    Manager {
        program: "dnf",
        refresh: &["makecache"],
        install: &["install", "-y", "qemu-system-arm"],
        needs_root: true,
    },
    Manager {
        program: "pacman",
        refresh: &["-Sy"],
        install: &["-S", "--noconfirm", "--needed", "qemu-system-arm"],
        needs_root: true,
    },
    Manager {
        program: "zypper",
        refresh: &["refresh"],
        install: &["install", "-y", "qemu-arm"],
        needs_root: true,
    },
    Manager { program: "apk", refresh: &["update"], install: &["add", "qemu-system-arm"], needs_root: true },
    Manager { program: "brew", refresh: &["update"], install: &["install", "qemu"], needs_root: false },
];

/// Installs target, components, emulator and crates.
pub fn run() -> Result<()> {
    target()?;
    component("clippy", &["clippy", "--version"])?;
    component("rustfmt", &["fmt", "--version"])?;
    qemu()?;
    fetch()
}

/// True when a program can be run and succeeds.
fn runs_ok(program: &str, args: &[&str]) -> bool {
    CommandLine::new(program, args)
        .quiet()
        .output_within(Duration::from_secs(60))
        .is_ok_and(|output| output.status.success())
}

/// The standard library for the firmware's target.
fn target() -> Result<()> {
    // From the compiler, not from rustup: a distribution's toolchain has it as well.
    let installed = || -> Result<bool> {
        let library =
            CommandLine::new("rustc", &["--print", "target-libdir", "--target", TARGET]).quiet().stdout()?;
        Ok(std::path::Path::new(library.trim()).is_dir())
    };
    if installed()? {
        return Ok(());
    }
    let command = format!("rustup target add {TARGET}");
    if CommandLine::new("rustup", &["target", "add", TARGET]).succeeds().unwrap_or(false) && installed()? {
        return Ok(());
    }
    bail!(
        "the Rust target {TARGET} is not installed. CommandLine `{command}` in the workspace (it needs a network once), or, \
         with a toolchain that is not rustup's, install its libraries for that target"
    )
}

/// A component of the toolchain that a cargo command needs.
fn component(name: &str, probe: &[&str]) -> Result<()> {
    let there = || {
        CommandLine::cargo(probe)
            .quiet()
            .output_within(Duration::from_secs(60))
            .is_ok_and(|output| output.status.success())
    };
    if there()
        || (CommandLine::new("rustup", &["component", "add", name]).succeeds().unwrap_or(false) && there())
    {
        return Ok(());
    }
    bail!("`cargo {}` does not work. Run `rustup component add {name}` in the workspace", probe.join(" "))
}

/// The emulator: found, or installed by the system's package manager.
fn qemu() -> Result<()> {
    if runs_ok(QEMU, &["--version"]) {
        return Ok(());
    }
    let Some(manager) = MANAGERS.iter().find(|manager| runs_ok(manager.program, &["--version"])) else {
        bail!(
            "{QEMU} is not installed, and no package manager that xtask knows is here. Install QEMU's system emulator \
             for Arm (5.0 or later) so that `{QEMU} --version` works, then run this command again"
        );
    };
    let prefix: &[&str] = if !manager.needs_root || is_root() {
        &[]
    } else if runs_ok("sudo", &["-n", "true"]) {
        &["sudo", "-n"]
    } else {
        let install = manager.install.join(" ");
        bail!(
            "{QEMU} is not installed, and installing it needs root. CommandLine\n\n    sudo {0} {1}; sudo {0} {install}\n\n\
             then run this command again",
            manager.program,
            manager.refresh.join(" "),
        )
    };
    let run = |args: &[&str]| {
        let all: Vec<&str> =
            prefix.iter().copied().chain([manager.program]).chain(args.iter().copied()).collect();
        let (program, args) = all.split_first().context("empty command")?;
        CommandLine::new(program, args).env("DEBIAN_FRONTEND", "noninteractive").succeeds()
    };
    // Package lists may be absent or old; refreshing them is slow.
    if !run(manager.install)? {
        run(manager.refresh)?;
        run(manager.install)?;
    }
    if runs_ok(QEMU, &["--version"]) {
        return Ok(());
    }
    bail!(
        "{} could not install QEMU. Run `{} {}` as root, see what it says, and run this command again",
        manager.program,
        manager.program,
        manager.install.join(" ")
    )
}

/// A browser for the report's test: found, or installed where that needs no question. Its absence fails nothing: the test
/// then says that it was skipped.
pub fn browser() {
    let there =
        || ["chromium", "chromium-browser", "google-chrome"].iter().any(|name| runs_ok(name, &["--version"]));
    if there() || !runs_ok("apt-get", &["--version"]) || !is_root() {
        return;
    }
    for args in [&["update"][..], &["install", "-y", "--no-install-recommends", "chromium"]] {
        let done = CommandLine::new("apt-get", args).env("DEBIAN_FRONTEND", "noninteractive").succeeds();
        if !done.unwrap_or(false) {
            break;
        }
    }
    if !there() {
        eprintln!(
            "warning: no Chromium could be installed; the test of the report in a browser will be skipped"
        );
    }
}

/// PyPI's cantools in an environment of its own below `target`, an independent reader of the DBC file. Its absence fails nothing: the
/// test then says that it was skipped.
pub fn cantools() {
    const VERSION: &str = "cantools==45.1.0";
    let folder = crate::folders::root().join("target/cantools");
    let python = folder.join("bin/python").display().to_string();
    if runs_ok(&python, &["-c", "import cantools"]) {
        return;
    }
    let folder = folder.display().to_string();
    let made = CommandLine::new("python3", &["-m", "venv", &folder]).succeeds().unwrap_or(false)
        && CommandLine::new(&python, &["-m", "pip", "install", "--quiet", VERSION])
            .succeeds()
            .unwrap_or(false);
    if !made {
        eprintln!(
            "warning: {VERSION} could not be installed; the test of the DBC file against it will be skipped"
        );
    }
}

fn is_root() -> bool {
    CommandLine::new("id", &["-u"]).quiet().stdout().is_ok_and(|id| id.trim() == "0")
}

/// All crates of the lock file, for every target.
fn fetch() -> Result<()> {
    let complete = CommandLine::cargo(&["fetch", "--locked", "--offline"])
        .quiet()
        .output_within(Duration::from_secs(120))?;
    if complete.status.success() {
        return Ok(());
    }
    if !CommandLine::cargo(&["fetch", "--locked"]).succeeds()? {
        // Not fatal: what the command needs may be here although something else is missing. The build decides.
        eprintln!("warning: not every crate could be fetched; without a network, builds may fail");
    }
    Ok(())
}
