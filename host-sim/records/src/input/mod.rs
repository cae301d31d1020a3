//! What every reader of a file shares: one error type that tells an engineer where to look and what is allowed.

mod error;
mod toml_file;

pub use error::{InputError, Range};
pub use toml_file::TomlFile;
