//! Supplies this board's memory map to the linker.
//!
//! cortex-m-rt's script includes `memory.x`, and linkers search the working directory first, which is the workspace's
//! root with the map of another board. The script is therefore copied from the output of cortex-m-rt's build, and
//! changed to include this board's map by its own name.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::time::SystemTime;
use std::{env, fs};

const MAP: &str = "memory-g474re.x";
const SCRIPT: &str = "link-g474re.x";

fn main() -> Result<(), Box<dyn Error>> {
    let out = PathBuf::from(env::var_os("OUT_DIR").unwrap_or_default());
    fs::copy(MAP, out.join(MAP))?;
    let script = runtime_script(&out)?;
    let own = script.replace("INCLUDE memory.x", &format!("INCLUDE {MAP}"));
    if own == script {
        return Err("cortex-m-rt's link.x does not include memory.x any more".into());
    }
    fs::write(out.join(SCRIPT), own)?;
    println!("cargo:rustc-link-search={}", out.display());
    for argument in ["--nmagic", &format!("-T{SCRIPT}"), "-Tdefmt.x"] {
        println!("cargo:rustc-link-arg-bins={argument}");
    }
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed={MAP}");
    Ok(())
}

/// Newest `link.x` that a build of cortex-m-rt for a device left next to this build's own folder. Its build script
/// has run before this one, because it declares `links`.
fn runtime_script(out: &Path) -> Result<String, Box<dyn Error>> {
    let builds = out.ancestors().nth(2).ok_or("OUT_DIR is not below a folder of builds")?;
    let mut newest: Option<(SystemTime, String)> = None;
    for entry in fs::read_dir(builds)? {
        let entry = entry?;
        let path = entry.path().join("out/link.x");
        if !entry.file_name().to_string_lossy().starts_with("cortex-m-rt-") || !path.is_file() {
            continue;
        }
        let script = fs::read_to_string(&path)?;
        let at = fs::metadata(&path)?.modified()?;
        // Binaries without a device have a different script, which lacks the interrupts' names.
        if script.contains("INCLUDE device.x") && newest.as_ref().is_none_or(|(newest, _)| at > *newest) {
            newest = Some((at, script));
        }
    }
    newest.map(|(_, script)| script).ok_or_else(|| "no build of cortex-m-rt has left a link.x".into())
}
