//! Test helpers: the built command line, run in a temporary folder.
#![allow(dead_code, reason = "each test binary uses its own part")]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// The project's root.
pub fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_path_buf()
}

/// A folder that is removed at the end.
pub struct Folder(tempfile::TempDir);

impl Folder {
    pub fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub fn write(&self, name: &str, text: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path(name);
        std::fs::write(&path, text).unwrap();
        path
    }
}

/// Runs `host-sim` with arguments, in the project's root.
pub fn host_sim<S: AsRef<std::ffi::OsStr>>(arguments: impl IntoIterator<Item = S>) -> Output {
    Command::new(env!("CARGO_BIN_EXE_host-sim")).args(arguments).current_dir(root()).output().unwrap()
}

/// Runs `host-sim`, and asserts exit code 0 and exactly one JSON object on standard output.
pub fn json<S: AsRef<std::ffi::OsStr>>(arguments: impl IntoIterator<Item = S>) -> serde_json::Value {
    let output = host_sim(arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let value: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(value.is_object());
    value
}

/// A calibration of the reference machine from the shipped bench table, by the reduced model because that is quick.
pub fn calibrated(folder: &Folder, class: &str) -> PathBuf {
    let out = folder.path("cal.toml");
    let files = ["--bench", "tests/data/bench_45.csv", "--machine", "host-sim/machines/reference.toml"];
    let options = ["--model", "rom", "--class", class, "--json", "--out", out.to_str().unwrap()];
    json(["identify"].iter().chain(&files).chain(&options));
    out
}

/// Runs `host-sim`, asserts the exit code and an empty standard output, and returns the text of standard error.
pub fn failure<S: AsRef<std::ffi::OsStr>>(code: i32, arguments: impl IntoIterator<Item = S>) -> String {
    let output = host_sim(arguments);
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code), "{error}");
    assert!(output.stdout.is_empty(), "{}", String::from_utf8_lossy(&output.stdout));
    error
}
