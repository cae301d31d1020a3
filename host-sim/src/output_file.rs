//! Output files: folders made on demand, and errors that name the file.

use std::fmt::Display;
use std::path::Path;

use kou_records::InputError;

/// Error of a file that cannot be written.
pub fn write_error<E: Display>(path: &Path) -> impl Fn(E) -> InputError {
    move |cause| InputError::new(format!("cannot be written: {cause}")).at_file(path)
}

/// Creates a folder and those above it.
///
/// # Errors
/// When the folder cannot be created.
pub fn create_folder(folder: &Path) -> Result<(), InputError> {
    std::fs::create_dir_all(folder)
        .map_err(|e| InputError::new(format!("folder cannot be created: {e}")).at_file(folder))
}

/// Creates the folder of a file.
///
/// # Errors
/// When the folder cannot be created.
pub fn create_folder_of(path: &Path) -> Result<(), InputError> {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).map_or(Ok(()), create_folder)
}

/// Writes a file.
///
/// # Errors
/// When the file cannot be written.
pub fn write_file(path: &Path, contents: impl AsRef<[u8]>) -> Result<(), InputError> {
    std::fs::write(path, contents).map_err(write_error(path))
}
