//! Set-up: what is missing is added, what is there is left alone, so that a second run needs no network.

use std::time::Duration;

use anyhow::{Context, Result, bail};

use crate::command::Run;
use crate::workspace::TARGET;

/// The emulator.
pub const QEMU: &str = "qemu-system-arm";

/// A package manager and how it installs the emulator.
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

/// Does the whole set-up.
pub fn run() -> Result<()> {
    target()?;
    component("clippy", &["clippy", "--version"])?;
    component("rustfmt", &["fmt", "--version"])?;
    qemu()?;
    fetch()
}

/// True when a program starts and ends well.
fn works(program: &str, words: &[&str]) -> bool {
    Run::new(program, words)
        .quiet()
        .output_within(Duration::from_secs(60))
        .is_ok_and(|output| output.status.success())
}

/// The standard library for the firmware's target.
fn target() -> Result<()> {
    // Asked of the compiler, not of rustup: true for a distribution's toolchain as well.
    let installed = || -> Result<bool> {
        let library =
            Run::new("rustc", &["--print", "target-libdir", "--target", TARGET]).quiet().stdout()?;
        Ok(std::path::Path::new(library.trim()).is_dir())
    };
    if installed()? {
        return Ok(());
    }
    let command = format!("rustup target add {TARGET}");
    if Run::new("rustup", &["target", "add", TARGET]).succeeds().unwrap_or(false) && installed()? {
        return Ok(());
    }
    bail!(
        "the Rust target {TARGET} is not installed. Run `{command}` in the workspace (it needs a network once), or, \
         with a toolchain that is not rustup's, install its libraries for that target"
    )
}

/// A component of the toolchain that a cargo command needs.
fn component(name: &str, probe: &[&str]) -> Result<()> {
    let there = || {
        Run::cargo(probe)
            .quiet()
            .output_within(Duration::from_secs(60))
            .is_ok_and(|output| output.status.success())
    };
    if there() || (Run::new("rustup", &["component", "add", name]).succeeds().unwrap_or(false) && there()) {
        return Ok(());
    }
    bail!("`cargo {}` does not work. Run `rustup component add {name}` in the workspace", probe.join(" "))
}

/// The emulator: found, or installed by the system's package manager.
fn qemu() -> Result<()> {
    if works(QEMU, &["--version"]) {
        return Ok(());
    }
    let Some(manager) = MANAGERS.iter().find(|manager| works(manager.program, &["--version"])) else {
        bail!(
            "{QEMU} is not installed, and no package manager that xtask knows is here. Install QEMU's system emulator \
             for Arm (5.0 or later) so that `{QEMU} --version` works, then run this command again"
        );
    };
    let prefix: &[&str] = if !manager.needs_root || is_root() {
        &[]
    } else if works("sudo", &["-n", "true"]) {
        &["sudo", "-n"]
    } else {
        let install = manager.install.join(" ");
        bail!(
            "{QEMU} is not installed, and installing it needs root. Run\n\n    sudo {0} {1}; sudo {0} {install}\n\n\
             then run this command again",
            manager.program,
            manager.refresh.join(" "),
        )
    };
    let run = |words: &[&str]| {
        let all: Vec<&str> =
            prefix.iter().copied().chain([manager.program]).chain(words.iter().copied()).collect();
        let (program, words) = all.split_first().context("empty command")?;
        Run::new(program, words).env("DEBIAN_FRONTEND", "noninteractive").succeeds()
    };
    // Lists may be absent or old: refreshed only then, because it takes long.
    if !run(manager.install)? {
        run(manager.refresh)?;
        run(manager.install)?;
    }
    if works(QEMU, &["--version"]) {
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
        || ["chromium", "chromium-browser", "google-chrome"].iter().any(|name| works(name, &["--version"]));
    if there() || !works("apt-get", &["--version"]) || !is_root() {
        return;
    }
    for words in [&["update"][..], &["install", "-y", "--no-install-recommends", "chromium"]] {
        let done = Run::new("apt-get", words).env("DEBIAN_FRONTEND", "noninteractive").succeeds();
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

/// PyPI's cantools in an environment of its own below `target`, the referee of the DBC file. Its absence fails nothing: the
/// test then says that it was skipped.
pub fn cantools() {
    const VERSION: &str = "cantools==45.1.0";
    let folder = crate::workspace::root().join("target/cantools");
    let python = folder.join("bin/python").display().to_string();
    if works(&python, &["-c", "import cantools"]) {
        return;
    }
    let folder = folder.display().to_string();
    let made = Run::new("python3", &["-m", "venv", &folder]).succeeds().unwrap_or(false)
        && Run::new(&python, &["-m", "pip", "install", "--quiet", VERSION]).succeeds().unwrap_or(false);
    if !made {
        eprintln!(
            "warning: {VERSION} could not be installed; the test of the DBC file against it will be skipped"
        );
    }
}

fn is_root() -> bool {
    Run::new("id", &["-u"]).quiet().stdout().is_ok_and(|id| id.trim() == "0")
}

/// All crates of the lock file, for every target.
fn fetch() -> Result<()> {
    let complete =
        Run::cargo(&["fetch", "--locked", "--offline"]).quiet().output_within(Duration::from_secs(120))?;
    if complete.status.success() {
        return Ok(());
    }
    if !Run::cargo(&["fetch", "--locked"]).succeeds()? {
        // Not fatal: what the command needs may be here although something else is missing. The build will tell.
        eprintln!("warning: not every crate could be fetched; without a network, builds may fail");
    }
    Ok(())
}
