//! Links with cortex-m-rt's script; `memory.x` is found in the workspace root, where cargo starts the linker.
fn main() {
    println!("cargo::rustc-link-arg-bins=-Tlink.x");
    println!("cargo::rerun-if-changed=build.rs");
}
