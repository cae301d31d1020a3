//! Packages of the workspace, their targets and dependencies, from `cargo metadata`.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, ensure};
use serde::Deserialize;

/// Output of `cargo metadata --no-deps`, as far as it is used here.
#[derive(Debug, Deserialize)]
pub struct Metadata {
    /// Root folder of the workspace.
    pub workspace_root: PathBuf,
    /// Packages of the workspace.
    pub packages: Vec<PackageMetadata>,
}

/// A package of the workspace.
#[derive(Debug, Deserialize)]
pub struct PackageMetadata {
    /// Name in its manifest.
    pub name: String,
    /// Path of its manifest.
    pub manifest_path: PathBuf,
    /// Direct dependencies of every kind.
    pub dependencies: Vec<Dependency>,
    /// Libraries, binaries, tests and so on.
    pub targets: Vec<CargoTarget>,
}

/// A direct dependency.
#[derive(Debug, Deserialize)]
pub struct Dependency {
    /// Name of the package.
    pub name: String,
    /// `None` for a normal one, else `dev` or `build`.
    pub kind: Option<String>,
}

/// A library, binary, test, bench or example.
#[derive(Debug, Deserialize)]
pub struct CargoTarget {
    /// Its kinds: `lib`, `bin`, `test`, ...
    pub kind: Vec<String>,
    /// Its name.
    pub name: String,
    /// Root source file.
    pub src_path: PathBuf,
}

impl Metadata {
    /// Asks cargo.
    pub fn load() -> Result<Self> {
        let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
        let output = Command::new(cargo)
            .args(["metadata", "--no-deps", "--format-version", "1"])
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .output()
            .context("starting `cargo metadata`")?;
        ensure!(
            output.status.success(),
            "`cargo metadata` failed:\n{}",
            String::from_utf8_lossy(&output.stderr)
        );
        serde_json::from_slice(&output.stdout).context("reading the output of `cargo metadata`")
    }

    /// A path as people write it: relative to the workspace's root.
    pub fn relative<'a>(&self, path: &'a Path) -> &'a Path {
        path.strip_prefix(&self.workspace_root).unwrap_or(path)
    }
}

impl PackageMetadata {
    /// Names of the packages that the package's own code needs; those of its tests only with `dev`.
    pub fn needs(&self, dev: bool) -> impl Iterator<Item = &str> {
        let counts = move |dependency: &&Dependency| dev || dependency.kind.as_deref() != Some("dev");
        self.dependencies.iter().filter(counts).map(|dependency| dependency.name.as_str())
    }

    /// True when the package has a library.
    pub fn has_library(&self) -> bool {
        self.targets.iter().any(CargoTarget::is_library)
    }
}

impl CargoTarget {
    /// True for a library.
    pub fn is_library(&self) -> bool {
        self.kind
            .iter()
            .any(|kind| kind == "lib" || kind == "rlib" || kind == "cdylib" || kind == "proc-macro")
    }

    /// True for what is shipped, and not for tests, benches, examples and build scripts.
    pub fn is_product(&self) -> bool {
        self.is_library() || self.kind.iter().any(|kind| kind == "bin")
    }

    /// Name of the crate in Rust paths.
    pub fn crate_name(&self) -> String {
        self.name.replace('-', "_")
    }
}
