//! Proof that the estimator cannot panic: it is linked alone with a panic handler that does not exist.

use anyhow::{Result, ensure};

use crate::command::CommandLine;
use crate::firmware::on_target;

const CHECK: &str = "kou-check-panic-never";
/// Name of the missing handler, in the linker's error.
const MISSING_HANDLER: &str = "panicking branch";

/// Links the estimator; fails if a panic path is left.
pub fn absent() -> Result<()> {
    ensure!(
        on_target(&["build", "--release", "-p", CHECK]).succeeds()?,
        "the estimator has a panic path (or does not build). To find it: build {CHECK} with `--emit=obj` and look \
         for calls to core::panicking in the disassembly"
    );
    Ok(())
}

/// Links it with a panic path added; fails if that links.
pub fn would_be_detected() -> Result<()> {
    let args = ["build", "--release", "-p", CHECK, "--features", "deliberate-panic"];
    let output = on_target(&args).output_within(CommandLine::BUILD_TIMEOUT)?;
    ensure!(
        !output.status.success(),
        "a deliberate panic path was linked: the panic-path check proves nothing"
    );
    ensure!(
        output.stderr.contains(MISSING_HANDLER),
        "the build with a deliberate panic path failed, but not because of that path:\n{}",
        output.stderr
    );
    Ok(())
}
