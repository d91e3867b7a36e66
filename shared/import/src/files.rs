//! Files of a source.

use crate::error::{At, ImportError};
use files::names::natural_order;
use std::path::{Path, PathBuf};

/// Names and absolute paths of the files of a folder with this ending, in natural order of their names. Empty for a file.
pub(crate) fn files(folder: &Path, end: &str) -> Result<Vec<(String, PathBuf)>, ImportError> {
    let mut files = Vec::new();
    if !folder.is_dir() {
        return Ok(files);
    }
    for entry in folder.read_dir().at(folder)? {
        let path = entry.at(folder)?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if name.ends_with(end) && !name.starts_with('.') && path.is_file() {
            let absolute = path.canonicalize().at(&path)?;
            files.push((name, absolute));
        }
    }
    files.sort_by(|a: &(String, PathBuf), b| natural_order(&a.0, &b.0));
    Ok(files)
}
