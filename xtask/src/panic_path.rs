//! The estimator linked alone with a panic handler that does not exist: linking proves that nothing can panic.

use anyhow::{Result, ensure};

use crate::command::Run;
use crate::firmware::on_target;

const CHECK: &str = "kou-check-panic-never";
/// What the missing handler is called; the linker says it.
const EVIDENCE: &str = "panicking branch";

/// Links it; fails if a panic path survives.
pub fn absent() -> Result<()> {
    ensure!(
        on_target(&["build", "--release", "-p", CHECK]).succeeds()?,
        "the estimator has a panic path (or does not build). To find it: build {CHECK} with `--emit=obj` and look \
         for calls to core::panicking in the disassembly"
    );
    Ok(())
}

/// Links it with a panic path added; fails if that is not noticed.
pub fn would_be_noticed() -> Result<()> {
    let words = ["build", "--release", "-p", CHECK, "--features", "deliberate-panic"];
    let output = on_target(&words).output_within(Run::BUILD_LIMIT)?;
    ensure!(
        !output.status.success(),
        "a deliberate panic path was linked: the panic-path check proves nothing"
    );
    ensure!(
        output.stderr.contains(EVIDENCE),
        "the build with a deliberate panic path failed, but not because of that path:\n{}",
        output.stderr
    );
    Ok(())
}
