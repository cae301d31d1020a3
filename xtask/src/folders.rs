//! Folders of the workspace.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

/// Root of the workspace: the folder above xtask.
pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap_or(Path::new("."))
}

/// A folder for results, below `out/`.
pub fn out_dir(name: &str) -> Result<PathBuf> {
    let folder = Path::new("out").join(name);
    let full = root().join(&folder);
    std::fs::create_dir_all(&full).with_context(|| format!("creating {}", full.display()))?;
    Ok(folder)
}
