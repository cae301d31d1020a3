//! Static checks of the sources, done by a program of its own: its parser would slow down every start of xtask.

use anyhow::Result;

use crate::command::CommandLine;
use crate::workspace::Workspace;

/// Package and program.
const PROGRAM: &str = "source-check";

/// Forbidden dependencies and circles of imports.
pub fn arrows(workspace: &Workspace) -> Result<()> {
    run(workspace, "arrows")
}

/// Links, paths, commands and names in the documents.
pub fn docs(workspace: &Workspace) -> Result<()> {
    run(workspace, "docs")
}

/// Type names that stand more than once, and words for which there is a standard term.
pub fn names(workspace: &Workspace) -> Result<()> {
    run(workspace, "names")
}

fn run(workspace: &Workspace, check: &str) -> Result<()> {
    CommandLine::cargo(&["build", "--quiet", "--bin", PROGRAM]).args(workspace.host_selection()).check()?;
    CommandLine::new(workspace.target_dir.join("debug").join(PROGRAM), &[check]).check()
}
