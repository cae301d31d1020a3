//! Packages and target folder of the workspace, from `cargo metadata`.

use std::path::PathBuf;

use anyhow::{Context, Result};
use serde_json::Value;

use crate::command::CommandLine;
use crate::folders::root;

/// Target triple of the firmware.
pub const TARGET: &str = "thumbv7em-none-eabihf";

/// A package of the workspace.
#[derive(Debug)]
pub struct Package {
    /// Its name.
    pub name: String,
    /// The folder of its manifest.
    pub folder: PathBuf,
    /// It has a library.
    pub is_library: bool,
}

/// Metadata of the workspace, from cargo.
#[derive(Debug)]
pub struct Workspace {
    /// Folder of build results.
    pub target_dir: PathBuf,
    /// All packages.
    pub packages: Vec<Package>,
}

impl Workspace {
    /// Asks cargo.
    pub fn load() -> Result<Self> {
        let text =
            CommandLine::cargo(&["metadata", "--no-deps", "--format-version", "1"]).quiet().stdout()?;
        let metadata: Value =
            serde_json::from_str(&text).context("reading the output of `cargo metadata`")?;
        let field = |value: &Value, name: &str| {
            value[name].as_str().map(str::to_owned).with_context(|| format!("`cargo metadata` has no {name}"))
        };
        let mut packages = Vec::new();
        for package in metadata["packages"].as_array().into_iter().flatten() {
            let manifest = PathBuf::from(field(package, "manifest_path")?);
            let folder = manifest.parent().unwrap_or(root()).to_owned();
            let targets = package["targets"].as_array().into_iter().flatten();
            let is_library =
                targets.flat_map(|target| target["kind"].as_array()).flatten().any(|kind| *kind == "lib");
            packages.push(Package { name: field(package, "name")?, folder, is_library });
        }
        Ok(Self { target_dir: field(&metadata, "target_directory")?.into(), packages })
    }

    /// The packages below a folder of the workspace.
    pub fn below(&self, folder: &str) -> impl Iterator<Item = &Package> {
        let folder = root().join(folder);
        self.packages.iter().filter(move |package| package.folder.starts_with(&folder))
    }

    /// The firmware's libraries: what boards and PC tool link alike.
    pub fn firmware_libraries(&self) -> impl Iterator<Item = &Package> {
        let is_program =
            |package: &&Package| self.programs_of_target().any(|other| other.name == package.name);
        self.below("firmware").filter(move |package| !is_program(package))
    }

    /// The programs that check the estimator on the target.
    pub fn target_checks(&self) -> impl Iterator<Item = &Package> {
        self.below("firmware/checks").filter(|package| !package.is_library)
    }

    /// Programs that compile for the target only.
    fn programs_of_target(&self) -> impl Iterator<Item = &Package> {
        self.below("firmware/boards").chain(self.target_checks())
    }

    /// `--workspace` without the packages that compile for the target only.
    ///
    /// Every host build uses this selection: another one would resolve other features and compile crates twice.
    pub fn host_selection(&self) -> Vec<String> {
        let mut args = vec!["--workspace".to_owned()];
        for package in self.programs_of_target() {
            args.extend(["--exclude".to_owned(), package.name.clone()]);
        }
        args
    }

    /// A release binary of the firmware.
    pub fn firmware_elf(&self, name: &str) -> PathBuf {
        self.target_dir.join(TARGET).join("release").join(name)
    }
}
