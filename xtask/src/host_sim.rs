//! Calls of `host-sim` on the shipped data, and their reports.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use serde_json::Value;

use crate::command::CommandLine;
use crate::workspace::Workspace;

/// Shipped bench points.
const BENCH: &str = "tests/data/bench_45.csv";
/// Shipped drive log.
pub const LOG: &str = "tests/data/drive.csv";
/// Machine of both.
const MACHINE: &str = "host-sim/machines/reference.toml";

/// The built program.
#[derive(Debug)]
pub struct HostSim {
    program: PathBuf,
}

impl HostSim {
    /// Builds it optimised, as users do.
    pub fn release(workspace: &Workspace) -> Result<Self> {
        CommandLine::cargo(&["build", "--release", "-p", "host-sim"]).check()?;
        Ok(Self { program: workspace.target_dir.join("release/host-sim") })
    }

    /// Builds it with the tests' profile, so that a test run compiles nothing more.
    pub fn as_tested(workspace: &Workspace) -> Result<Self> {
        CommandLine::cargo(&["build", "--bin", "host-sim"]).args(workspace.host_selection()).check()?;
        Ok(Self { program: workspace.target_dir.join("debug/host-sim") })
    }

    /// Identifies a calibration from the shipped bench points.
    pub fn identify(&self, calibration: &Path) -> Result<Value> {
        let args = ["identify", "--bench", BENCH, "--machine", MACHINE, "--model", "full", "--json", "--out"];
        self.json(&args, [calibration])
    }

    /// Writes the report on the shipped bench points.
    pub fn report(&self, page: &Path) -> Result<()> {
        let args = ["report", "--bench", BENCH, "--machine", MACHINE, "--out"];
        CommandLine::new(&self.program, &args).args([page]).check()
    }

    /// Compares the estimator with the lumped model over the envelope.
    pub fn verify(&self, calibration: &Path) -> Result<Value> {
        self.json(&["verify", "--machine", MACHINE, "--json", "--calibration"], [calibration])
    }

    /// Replays the shipped log on the host.
    pub fn replay(&self, calibration: &Path, estimates: &Path, plot: &Path) -> Result<Value> {
        let (out, picture) = (Path::new("--out"), Path::new("--plot"));
        let args = ["replay", "--log", LOG, "--json", "--calibration"];
        self.json(&args, [calibration, out, estimates, picture, plot])
    }

    /// Replays the shipped log through the firmware in QEMU and compares with the host.
    pub fn pil(&self, calibration: &Path) -> Result<Value> {
        self.json(&["pil", "--log", LOG, "--json", "--calibration"], [calibration])
    }

    fn json<'a>(&self, args: &[&str], paths: impl IntoIterator<Item = &'a Path>) -> Result<Value> {
        let run = CommandLine::new(&self.program, args).args(paths);
        let line = run.line();
        let mut text = String::new();
        let status = run.each_line(|line| {
            text.push_str(line);
            text.push('\n');
        })?;
        // A failed check still prints its figures; show them before giving up.
        match status.code() {
            Some(0) => {}
            Some(1) => bail!("a check of `{line}` failed. It reported:\n{text}"),
            _ => bail!("`{line}` failed ({status}); its own message is above"),
        }
        serde_json::from_str(&text)
            .with_context(|| format!("`{line}` did not print one JSON object:\n{text}"))
    }
}

/// A number of a report.
pub fn number(report: &Value, key: &str) -> Result<f64> {
    report[key].as_f64().with_context(|| format!("host-sim's report has no number `{key}`: {report}"))
}
