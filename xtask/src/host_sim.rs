//! Calling `host-sim` on the shipped data, and reading what it says.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use serde_json::Value;

use crate::command::Run;
use crate::workspace::{Workspace, root};

/// Bench points that are shipped.
const BENCH: &str = "tests/data/bench_45.csv";
/// Drive log that is shipped.
pub const LOG: &str = "tests/data/drive.csv";
/// Machine that both are of.
const MACHINE: &str = "host-sim/machines/reference.toml";

/// The built program.
#[derive(Debug)]
pub struct HostSim {
    program: PathBuf,
}

impl HostSim {
    /// Builds it optimised: for people.
    pub fn release(workspace: &Workspace) -> Result<Self> {
        Run::cargo(&["build", "--release", "-p", "host-sim"]).check()?;
        Ok(Self { program: workspace.target_dir.join("release/host-sim") })
    }

    /// Builds it as the tests do, so that a test run compiles nothing more.
    pub fn as_tested(workspace: &Workspace) -> Result<Self> {
        Run::cargo(&["build", "--bin", "host-sim"]).args(workspace.host_selection()).check()?;
        Ok(Self { program: workspace.target_dir.join("debug/host-sim") })
    }

    /// Identifies a calibration from the shipped bench points.
    pub fn identify(&self, calibration: &Path) -> Result<Value> {
        let words =
            ["identify", "--bench", BENCH, "--machine", MACHINE, "--model", "full", "--json", "--out"];
        self.json(&words, [calibration])
    }

    /// Writes the report on the shipped bench points; it says nothing but where.
    pub fn report(&self, page: &Path) -> Result<()> {
        let words = ["report", "--bench", BENCH, "--machine", MACHINE, "--out"];
        Run::new(&self.program, &words).args([page]).check()
    }

    /// Compares the estimator with the full model over the envelope.
    pub fn verify(&self, calibration: &Path) -> Result<Value> {
        self.json(&["verify", "--machine", MACHINE, "--json", "--calibration"], [calibration])
    }

    /// Replays the shipped log on the host.
    pub fn replay(&self, calibration: &Path, estimates: &Path, plot: &Path) -> Result<Value> {
        let (out, picture) = (Path::new("--out"), Path::new("--plot"));
        let words = ["replay", "--log", LOG, "--json", "--calibration"];
        self.json(&words, [calibration, out, estimates, picture, plot])
    }

    /// Replays the shipped log through the firmware in QEMU and compares with the host.
    pub fn pil(&self, calibration: &Path) -> Result<Value> {
        self.json(&["pil", "--log", LOG, "--json", "--calibration"], [calibration])
    }

    fn json<'a>(&self, words: &[&str], paths: impl IntoIterator<Item = &'a Path>) -> Result<Value> {
        let run = Run::new(&self.program, words).args(paths);
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
            _ => bail!("`{line}` failed ({status}); its own message stands above"),
        }
        serde_json::from_str(&text)
            .with_context(|| format!("`{line}` did not print one JSON object:\n{text}"))
    }
}

/// A number of a report.
pub fn number(report: &Value, key: &str) -> Result<f64> {
    report[key].as_f64().with_context(|| format!("host-sim's report has no number `{key}`: {report}"))
}

/// A folder for results, below `out/`.
pub fn out_dir(name: &str) -> Result<PathBuf> {
    let folder = Path::new("out").join(name);
    let full = root().join(&folder);
    std::fs::create_dir_all(&full).with_context(|| format!("creating {}", full.display()))?;
    Ok(folder)
}
