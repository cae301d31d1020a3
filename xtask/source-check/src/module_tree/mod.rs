//! Modules of a crate, what they define and what they name: a small model of Rust's name resolution.
//!
//! It knows `mod`, `use` (grouped, renamed, glob, re-exported), paths in expressions, types, patterns and attributes, and
//! paths in the tokens of macro calls. It does not know types: a method call names nothing. Code under `#[cfg(test)]` is
//! left out.

mod collect;
mod resolve;
mod tree;

pub use resolve::Resolution;
#[cfg(test)]
pub use tree::Sources;
pub use tree::{Disk, ModuleId, ModuleTree, SourceModule};
